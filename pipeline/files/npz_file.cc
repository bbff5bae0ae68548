#include "pipeline/files/npz_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zip.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/zip_directory.h"

namespace regrade {
namespace {

constexpr char kSuffix[] = ".npy";
constexpr zip_uint16_t kFirstZipDay = (0 << 9) | (1 << 5) | 1;  // 1980-01-01

// Any failure here is ours or the machine's memory: nothing has touched the disk yet.
void RequireZip(bool ok, const char* step) {
  if (!ok)
    throw Error(ExitCode::kResources, std::string("cannot ") + step + " an archive in memory");
}

}  // namespace

struct NpzWriter::Member {
  std::string name;
  std::string header;
  std::string copy;  // when the data is ours
  const void* data;  // null: `copy`
  uint64_t size;
  NpzPacking packing;
};

NpzWriter::NpzWriter() = default;
NpzWriter::~NpzWriter() = default;

void NpzWriter::AddBytes(const std::string& name, ArrayType type,
                         const std::vector<int64_t>& shape, const void* data,
                         NpzPacking packing) {
  uint64_t size = static_cast<uint64_t>(SizeOf(type));
  for (const int64_t axis : shape) size *= static_cast<uint64_t>(axis);
  members_.push_back({name, MakeNpyHeader(type, shape), "", data, size, packing});
}

void NpzWriter::AddCopy(const std::string& name, ArrayType type,
                        const std::vector<int64_t>& shape, const void* data, size_t size) {
  members_.push_back({name, MakeNpyHeader(type, shape),
                      std::string(static_cast<const char*>(data), size), nullptr, size,
                      NpzPacking::kStore});
}

std::string NpzWriter::Bytes() const {
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* target = zip_source_buffer_create(nullptr, 0, 0, &error);
  RequireZip(target != nullptr, "begin");
  zip_source_keep(target);
  const std::unique_ptr<zip_source_t, decltype(&zip_source_free)> target_owner(
      target, &zip_source_free);
  zip_t* archive = zip_open_from_source(target, ZIP_TRUNCATE, &error);
  if (archive == nullptr) zip_source_free(target);
  RequireZip(archive != nullptr, "open");
  std::unique_ptr<zip_t, decltype(&zip_discard)> archive_owner(archive, &zip_discard);

  for (const Member& member : members_) {
    const void* data = member.data != nullptr ? member.data : member.copy.data();
    std::array<zip_buffer_fragment_t, 2> parts{};
    parts[0].data = reinterpret_cast<zip_uint8_t*>(const_cast<char*>(member.header.data()));
    parts[0].length = member.header.size();
    parts[1].data = static_cast<zip_uint8_t*>(const_cast<void*>(data));
    parts[1].length = member.size;
    zip_source_t* source =
        zip_source_buffer_fragment(archive, parts.data(), member.size > 0 ? 2 : 1, 0);
    RequireZip(source != nullptr, "fill");
    const zip_int64_t index =
        zip_file_add(archive, (member.name + kSuffix).c_str(), source, ZIP_FL_ENC_UTF_8);
    if (index < 0) zip_source_free(source);
    RequireZip(index >= 0, "fill");
    const auto position = static_cast<zip_uint64_t>(index);
    const bool deflate = member.packing == NpzPacking::kDeflate;
    RequireZip(
        zip_set_file_compression(archive, position, deflate ? ZIP_CM_DEFLATE : ZIP_CM_STORE,
                                 deflate ? 1 : 0) == 0 &&
            zip_file_set_dostime(archive, position, 0, kFirstZipDay, 0) == 0,
        "describe a member of");
  }
  RequireZip(zip_close(archive) == 0, "finish");
  archive_owner.release();

  zip_stat_t status;
  RequireZip(zip_source_stat(target, &status) == 0 && zip_source_open(target) == 0, "read");
  std::string bytes(status.size, '\0');
  uint64_t done = 0;
  while (done < bytes.size()) {
    const zip_int64_t n = zip_source_read(target, bytes.data() + done, bytes.size() - done);
    RequireZip(n > 0, "read");
    done += static_cast<uint64_t>(n);
  }
  zip_source_close(target);
  return bytes;
}

void NpzWriter::WriteTo(const std::string& path) const { WriteFileAtomically(path, Bytes()); }

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
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) ThrowReadError(path);
  const std::unique_ptr<const int, void (*)(const int*)> closer(
      &fd, [](const int* f) { ::close(*f); });
  struct stat status;
  if (::fstat(fd, &status) != 0) ThrowReadError(path);
  if (!S_ISREG(status.st_mode)) throw Error(ExitCode::kInput, "not a regular file", path);
  const ReadAt read_at = [fd, &path](uint64_t offset, void* to, size_t size) {
    size_t done = 0;
    while (done < size) {
      const ssize_t n = ::pread(fd, static_cast<char*>(to) + done, size - done,
                                static_cast<off_t>(offset + done));
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0)
        throw Error(ExitCode::kInput, n < 0 ? std::strerror(errno) : "the file ends too early",
                    path);
      done += static_cast<size_t>(n);
    }
  };
  archive_->members = ReadZipDirectory(static_cast<uint64_t>(status.st_size), read_at, path);
  int error = 0;
  const int own = ::fcntl(fd, F_DUPFD_CLOEXEC, 0);
  archive_->zip = own < 0 ? nullptr : zip_fdopen(own, 0, &error);
  if (archive_->zip == nullptr) {
    if (own >= 0) ::close(own);
    throw Error(ExitCode::kInput, "this zip archive cannot be opened", path);
  }
}

NpzReader::~NpzReader() = default;

std::vector<std::string> NpzReader::names() const {
  std::vector<std::string> names;
  for (const ZipMember& member : archive_->members) {
    const size_t stem = member.name.size() - std::min(member.name.size(), strlen(kSuffix));
    if (member.name.compare(stem, std::string::npos, kSuffix) == 0)
      names.push_back(member.name.substr(0, stem));
  }
  return names;
}

bool NpzReader::Has(const std::string& name) const { return archive_->Find(name) != nullptr; }

NpzArray NpzReader::Read(const std::string& name) {
  const std::string where = path_ + ": array '" + name + "'";
  const ZipMember* member = archive_->Find(name);
  if (member == nullptr) throw Error(ExitCode::kInput, "is missing", where);
  if (member->bytes > budget_)
    throw Error(ExitCode::kInput,
                std::to_string(member->bytes) + " bytes, more than the " +
                    std::to_string(budget_) + " that may still be read",
                where, "give more memory with --max-memory");
  budget_ -= member->bytes;

  const zip_int64_t index = zip_name_locate(archive_->zip, member->name.c_str(), 0);
  const std::unique_ptr<zip_file_t, decltype(&zip_fclose)> file(
      index < 0 ? nullptr : zip_fopen_index(archive_->zip, static_cast<zip_uint64_t>(index), 0),
      &zip_fclose);
  if (file == nullptr) throw Error(ExitCode::kInput, "cannot be unpacked", where);
  uint64_t left = member->bytes;
  const auto read = [&](void* to, uint64_t size) {
    uint64_t done = 0;
    while (done < size) {
      const zip_int64_t n = zip_fread(file.get(), static_cast<char*>(to) + done, size - done);
      if (n <= 0)
        throw Error(ExitCode::kInput,
                    n < 0 ? "its checksum or packing is wrong" : "it ends too early", where,
                    "the file is damaged: make it again");
      done += static_cast<uint64_t>(n);
    }
    left -= size;
  };

  // The fixed part tells how long the header is, the header how long the data.
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
  const uint64_t surplus = head.size() - header.data_offset;  // only for tiny, odd headers
  if (header.data_bytes != left + surplus)
    throw Error(ExitCode::kInput,
                "its shape asks for " + std::to_string(header.data_bytes) + " bytes, it has " +
                    std::to_string(left + surplus),
                where);
  NpzArray array{header.type, header.shape, {}};
  array.bytes.Resize(static_cast<int64_t>(header.data_bytes));
  if (surplus > 0) std::memcpy(array.bytes.data(), &head[header.data_offset], surplus);
  read(array.bytes.data() + surplus, left);
  // The checksum is compared when the end is met.
  char beyond;
  if (zip_fread(file.get(), &beyond, 1) != 0)
    throw Error(ExitCode::kInput, "its checksum or length is wrong", where,
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
    throw Error(ExitCode::kInput,
                std::string(NameOf(array.type)) + array.ShapeText() + ", expected " +
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
    throw Error(ExitCode::kInput,
                "written in format " + std::to_string(version) + ", this program knows up to " +
                    std::to_string(known),
                file->path(), "update regrade; the file has not been touched");
}

}  // namespace regrade
