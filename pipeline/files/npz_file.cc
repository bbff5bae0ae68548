#include "pipeline/files/npz_file.h"

#include <zip.h>

#include <algorithm>
#include <cstring>

#include "kernels/base/error.h"
#include "kernels/base/file_descriptor.h"
#include "pipeline/files/atomic_file.h"

namespace regrade {
namespace {

constexpr char kSuffix[] = ".npy";
constexpr zip_int64_t kMaxMembers = 10000;
constexpr uint64_t kMaxRatio = 1032;    // of deflate
constexpr int64_t kRowBytes = 4 << 20;  // of rows that are read together

[[noreturn]] void RefuseArchive(const std::string& path, const std::string& why) {
  throw InputError("zip archive: " + why, path,
                   "the file is damaged or malicious: make it again or get it from its source");
}

std::string OpenProblem(int code) {
  if (code == ZIP_ER_INCONS) return "its directory and its members' headers disagree";
  if (code == ZIP_ER_EXISTS) return "a member's name appears twice";
  if (code == ZIP_ER_NOZIP) return "it has no valid directory";
  zip_error_t error;
  zip_error_init_with_code(&error, code);
  const std::string text = zip_error_strerror(&error);
  zip_error_fini(&error);
  return text;
}

struct ZipMember {
  zip_uint64_t index = 0;
  std::string name;
  uint64_t bytes = 0;  // as declared
};

// libzip has compared the directory with the members' headers; this adds what it does not
// check.
std::vector<ZipMember> CheckedMembers(zip_t* zip, uint64_t file_bytes,
                                      const std::string& path) {
  const zip_int64_t count = zip_get_num_entries(zip, 0);
  if (count > kMaxMembers)
    RefuseArchive(path, Concat(count, " members, more than ", kMaxMembers));
  std::vector<ZipMember> members;
  uint64_t packed = 0;
  for (zip_uint64_t i = 0; i < static_cast<zip_uint64_t>(count); ++i) {
    zip_stat_t status;
    constexpr zip_uint64_t kNeeded = ZIP_STAT_NAME | ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE |
                                     ZIP_STAT_COMP_METHOD | ZIP_STAT_ENCRYPTION_METHOD;
    if (zip_stat_index(zip, i, 0, &status) != 0 || (status.valid & kNeeded) != kNeeded)
      RefuseArchive(path, Concat("member ", i, " is not described"));
    const std::string name = "'" + std::string(status.name) + "'";
    if (status.encryption_method != ZIP_EM_NONE) RefuseArchive(path, name + " is encrypted");
    const bool stored = status.comp_method == ZIP_CM_STORE;
    if (!stored && status.comp_method != ZIP_CM_DEFLATE)
      RefuseArchive(path, Concat(name, " is packed by method ", status.comp_method,
                                 "; 0 and 8 are supported"));
    if (stored && status.size != status.comp_size)
      RefuseArchive(path, name + " is stored, but its two sizes differ");
    if (status.size / kMaxRatio > status.comp_size)
      RefuseArchive(path, Concat(name, " claims ", status.size, " bytes out of ",
                                 status.comp_size, ", more than deflate can do"));
    if (status.comp_size > file_bytes - packed)
      RefuseArchive(path, "its members share bytes: they claim more than the file has");
    packed += status.comp_size;
    members.push_back({i, status.name, status.size});
  }
  return members;
}

}  // namespace

std::string NpzArray::ShapeText() const {
  std::string text = "(";
  for (const int64_t axis : shape) text += (text.size() > 1 ? ", " : "") + std::to_string(axis);
  return text + ")";
}

struct NpzReader::Archive {
  std::vector<ZipMember> members;
  zip_t* zip = nullptr;
  ~Archive() {
    if (zip != nullptr) zip_discard(zip);
  }
  const ZipMember* Find(const std::string& name) const {
    for (const ZipMember& member : members)
      if (member.name == name + kSuffix) return &member;
    return nullptr;
  }
};

NpzReader::NpzReader(const std::string& path, uint64_t budget)
    : path_(path), budget_(budget), archive_(std::make_unique<Archive>()) {
  uint64_t size = 0;
  FileDescriptor fd(OpenToRead(path, &size));
  int code = 0;
  archive_->zip = zip_fdopen(fd.get(), ZIP_CHECKCONS, &code);
  if (archive_->zip == nullptr) {
    if (code == ZIP_ER_READ || code == ZIP_ER_OPEN) ThrowReadError(path);  // libzip sets errno
    RefuseArchive(path, OpenProblem(code));
  }
  fd.Release();
  archive_->members = CheckedMembers(archive_->zip, size, path);
}

NpzReader::~NpzReader() = default;

std::vector<std::string> NpzReader::names() const {
  std::vector<std::string> names;
  for (const ZipMember& member : archive_->members) {
    const std::string& name = member.name;
    if (name.ends_with(kSuffix)) names.push_back(name.substr(0, name.size() - strlen(kSuffix)));
  }
  return names;
}

bool NpzReader::Has(const std::string& name) const { return archive_->Find(name) != nullptr; }

// A member that is read from its beginning to its end.
class NpzReader::OpenMember {
 public:
  OpenMember(zip_t* zip, const ZipMember& member, std::string where)
      : where_(std::move(where)),
        file_(zip_fopen_index(zip, member.index, 0), &zip_fclose),
        bytes_(member.bytes),
        left_(member.bytes) {
    if (file_ == nullptr) throw InputError("cannot be unpacked", where_);
    ReadHeader();
  }

  uint64_t bytes() const { return bytes_; }  // with the header
  const NpyHeader& header() const { return header_; }

  void Read(void* to, uint64_t size) {
    const uint64_t ahead = std::min<uint64_t>(size, head_.size());
    std::memcpy(to, head_.data(), ahead);
    head_.erase(0, ahead);
    Unpack(static_cast<char*>(to) + ahead, size - ahead);
  }

  // libzip compares the checksum at the end of the member.
  void Finish() {
    char beyond;
    if (zip_fread(file_.get(), &beyond, 1) != 0)
      throw InputError("its checksum or length is wrong", where_,
                       "the file is damaged: make it again");
  }

 private:
  void Unpack(char* to, uint64_t size) {
    uint64_t done = 0;
    while (done < size) {
      const zip_int64_t n = zip_fread(file_.get(), to + done, size - done);
      if (n <= 0)
        throw InputError(n < 0 ? "its checksum or packing is wrong" : "it ends too early",
                         where_, "the file is damaged: make it again");
      done += static_cast<uint64_t>(n);
    }
    left_ -= size;
  }

  // The fixed part gives the header's length, the header the length of the data.
  void ReadHeader() {
    std::string head(std::min<uint64_t>(12, left_), '\0');
    Unpack(head.data(), head.size());
    const size_t prefix = head.size() == 12 && head[6] > 1 ? 12 : 10;
    if (head.size() == 12) {
      uint64_t length = 0;
      for (size_t i = prefix; i-- > 8;)
        length = length << 8 | static_cast<unsigned char>(head[i]);
      const uint64_t total = prefix + std::min<uint64_t>(length, 64 << 10);
      if (total > head.size()) {
        const size_t have = head.size();
        head.resize(have + std::min(total - have, left_));
        Unpack(head.data() + have, head.size() - have);
      }
    }
    header_ = ParseNpyHeader(head, where_);
    head_ = head.substr(header_.data_offset);
    if (header_.data_bytes != left_ + head_.size())
      throw InputError(Concat("its shape asks for ", header_.data_bytes, " bytes, it has ",
                              left_ + head_.size()),
                       where_);
  }

  std::string where_;
  std::unique_ptr<zip_file_t, decltype(&zip_fclose)> file_;
  uint64_t bytes_, left_;
  NpyHeader header_;
  std::string head_;  // data that came with a header shorter than the fixed part
};

NpzReader::OpenMember NpzReader::Open(const std::string& name) {
  const std::string where = path_ + ": array '" + name + "'";
  const ZipMember* member = archive_->Find(name);
  if (member == nullptr) throw InputError("is missing", where);
  return {archive_->zip, *member, where};
}

NpzReader::OpenMember NpzReader::OpenWithinBudget(const std::string& name) {
  OpenMember member = Open(name);
  if (member.bytes() > budget_)
    throw InputError(
        Concat(member.bytes(), " bytes, more than the ", budget_, " that may still be read"),
        path_ + ": array '" + name + "'", "give more memory with --max-memory");
  budget_ -= member.bytes();
  return member;
}

NpzArray NpzReader::Describe(const std::string& name) {
  const NpyHeader header = Open(name).header();
  return {header.type, header.shape, {}};
}

NpzArray NpzReader::Read(const std::string& name) {
  OpenMember member = OpenWithinBudget(name);
  const NpyHeader& header = member.header();
  NpzArray array{header.type, header.shape, {}};
  array.bytes.Resize(static_cast<int64_t>(header.data_bytes));
  member.Read(array.bytes.data(), header.data_bytes);
  member.Finish();
  return array;
}

void NpzReader::ReadRows(const std::string& name,
                         const std::function<void(int64_t first, const NpzArray& rows)>& take) {
  OpenMember member = OpenWithinBudget(name);
  const NpyHeader& header = member.header();
  NpzArray rows{header.type, header.shape, {}};
  const int64_t count = header.shape.empty() ? 1 : header.shape[0];
  const int64_t each = count > 0 ? static_cast<int64_t>(header.data_bytes) / count : 0;
  if (each == 0) take(0, rows);
  const int64_t step = std::max<int64_t>(1, kRowBytes / std::max<int64_t>(each, 1));
  for (int64_t first = 0; each > 0 && first < count; first += step) {
    const int64_t here = std::min(step, count - first);
    if (!rows.shape.empty()) rows.shape[0] = here;
    rows.bytes.Resize(here * each);
    member.Read(rows.bytes.data(), static_cast<uint64_t>(here * each));
    take(first, rows);
  }
  member.Finish();
}

NpzArray NpzReader::Read(const std::string& name, ArrayType type,
                         const std::vector<int64_t>& shape) {
  NpzArray array = Read(name);
  bool fits = array.type == type && array.shape.size() == shape.size();
  for (size_t i = 0; fits && i < shape.size(); ++i)
    fits = shape[i] < 0 || shape[i] == array.shape[i];
  if (!fits) {
    NpzArray expected{type, shape, {}};
    throw InputError(std::string(NameOf(array.type)) + array.ShapeText() + ", expected " +
                         NameOf(type) + expected.ShapeText(),
                     path_ + ": array '" + name + "'");
  }
  return array;
}

std::string NpzReader::ReadText(const std::string& name) {
  const NpzArray array = Read(name, ArrayType::kU8, {-1});
  return std::string(array.As<char>(), static_cast<size_t>(array.bytes.size()));
}

void RefuseNewerFormat(NpzReader* file, int32_t known) {
  if (!file->Has("regrade_version")) return;
  const int32_t version = file->ReadScalar<int32_t>("regrade_version");
  if (version > known)
    throw InputError(
        Concat("written in format ", version, ", this program reads up to ", known),
        file->path(), "update regrade; the file has not been touched");
}

}  // namespace regrade
