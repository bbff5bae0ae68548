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
constexpr uint64_t kMaxRatio = 1032;  // of deflate

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

NpzArray NpzReader::Read(const std::string& name) {
  const std::string where = path_ + ": array '" + name + "'";
  const ZipMember* member = archive_->Find(name);
  if (member == nullptr) throw InputError("is missing", where);
  if (member->bytes > budget_)
    throw InputError(
        Concat(member->bytes, " bytes, more than the ", budget_, " that may still be read"),
        where, "give more memory with --max-memory");
  budget_ -= member->bytes;

  const std::unique_ptr<zip_file_t, decltype(&zip_fclose)> file(
      zip_fopen_index(archive_->zip, member->index, 0), &zip_fclose);
  if (file == nullptr) throw InputError("cannot be unpacked", where);
  uint64_t left = member->bytes;
  const auto read = [&](void* to, uint64_t size) {
    uint64_t done = 0;
    while (done < size) {
      const zip_int64_t n = zip_fread(file.get(), static_cast<char*>(to) + done, size - done);
      if (n <= 0)
        throw InputError(n < 0 ? "its checksum or packing is wrong" : "it ends too early",
                         where, "the file is damaged: make it again");
      done += static_cast<uint64_t>(n);
    }
    left -= size;
  };

  // The fixed part gives the header's length, the header the length of the data.
  std::string head(std::min<uint64_t>(12, left), '\0');
  read(head.data(), head.size());
  const size_t prefix = head.size() == 12 && head[6] > 1 ? 12 : 10;
  if (head.size() == 12) {
    uint64_t length = 0;
    for (size_t i = prefix; i-- > 8;)
      length = length << 8 | static_cast<unsigned char>(head[i]);
    const uint64_t total = prefix + std::min<uint64_t>(length, 64 << 10);
    if (total > head.size()) {
      const size_t have = head.size();
      head.resize(have + std::min(total - have, left));
      read(head.data() + have, head.size() - have);
    }
  }
  const NpyHeader header = ParseNpyHeader(head, where);
  const uint64_t surplus =
      head.size() - header.data_offset;  // of headers shorter than the fixed part
  if (header.data_bytes != left + surplus)
    throw InputError(
        Concat("its shape asks for ", header.data_bytes, " bytes, it has ", left + surplus),
        where);
  NpzArray array{header.type, header.shape, {}};
  array.bytes.Resize(static_cast<int64_t>(header.data_bytes));
  if (surplus > 0) std::memcpy(array.bytes.data(), &head[header.data_offset], surplus);
  read(array.bytes.data() + surplus, left);
  // libzip compares the checksum at the end of the member.
  char beyond;
  if (zip_fread(file.get(), &beyond, 1) != 0)
    throw InputError("its checksum or length is wrong", where,
                     "the file is damaged: make it again");
  return array;
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
