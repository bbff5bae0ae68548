// Writes .npz archives. libzip lays out the members; its target is an AtomicFile, so that bytes
// reach the disk as they are made.
#include <zip.h>

#include <algorithm>
#include <cstring>
#include <exception>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/npz_file.h"

namespace regrade {
namespace {

constexpr zip_uint16_t kFirstZipDay = (0 << 9) | (1 << 5) | 1;  // 1980-01-01
constexpr uint64_t kPieceBytes = 4 << 20;                       // of a filled array
constexpr uint64_t kHeaderBytes = 256;                          // of a member, roughly

void RequireZip(bool ok, const char* step) {
  if (!ok) throw ResourceError(std::string("cannot ") + step + " an archive");
}

// State that libzip's callbacks share. Exceptions may not pass through libzip: the first one
// waits here until the call into libzip has returned.
struct Writing {
  AtomicFile file;
  std::exception_ptr failure;

  template <typename Call>
  zip_int64_t Guarded(const Call& call) {
    try {
      return call();
    } catch (...) {
      if (failure == nullptr) failure = std::current_exception();
      return -1;
    }
  }
};

zip_int64_t ReportFailure(void* data, zip_uint64_t size) {
  zip_error_t error;
  zip_error_init_with_code(&error, ZIP_ER_WRITE);
  return zip_error_to_data(&error, data, size);
}

// libzip's view of the file to be written: empty, and never read.
zip_int64_t WriteArchive(void* user, void* data, zip_uint64_t size, zip_source_cmd_t command) {
  Writing* const writing = static_cast<Writing*>(user);
  AtomicFile& file = writing->file;
  switch (command) {
    case ZIP_SOURCE_SUPPORTS:
      return ZIP_SOURCE_SUPPORTS_WRITABLE;
    case ZIP_SOURCE_STAT:
      zip_stat_init(static_cast<zip_stat_t*>(data));
      return sizeof(zip_stat_t);
    case ZIP_SOURCE_WRITE:
      return writing->Guarded([&] {
        file.Write(data, size);
        return static_cast<zip_int64_t>(size);
      });
    case ZIP_SOURCE_SEEK_WRITE: {
      const zip_int64_t offset =
          zip_source_seek_compute_offset(file.position(), file.size(), data, size, nullptr);
      if (offset < 0) return -1;
      return writing->Guarded([&]() -> zip_int64_t {
        file.Seek(static_cast<uint64_t>(offset));
        return 0;
      });
    }
    case ZIP_SOURCE_TELL_WRITE:
      return static_cast<zip_int64_t>(file.position());
    case ZIP_SOURCE_ERROR:
      return ReportFailure(data, size);
    default:
      return 0;
  }
}

}  // namespace

struct NpzWriter::Member {
  std::string name;
  std::string header;
  std::string copy;   // when the data is ours
  const void* data;   // null: `fill` if there is one, else `copy`
  uint64_t size;      // of the data
  uint64_t rows = 0;  // for `fill`
  RowFunction fill;
  NpzPacking packing;
};

// A member's bytes for libzip: the header, then the data.
struct NpzWriter::MemberSource {
  const Member* member;
  Writing* writing;
  uint64_t position = 0;
  std::vector<char> piece;  // of filled rows, from byte `piece_begin` of the data
  uint64_t piece_begin = 0;

  uint64_t TotalBytes() const { return member->header.size() + member->size; }

  // Fills the piece that holds byte `at` of the data.
  void FillPiece(uint64_t at) {
    const uint64_t row_bytes = member->size / member->rows;
    const uint64_t most = std::max<uint64_t>(1, kPieceBytes / row_bytes);
    const uint64_t first = at / row_bytes, rows = std::min(most, member->rows - first);
    piece.resize(rows * row_bytes);
    member->fill(static_cast<int64_t>(first), static_cast<int64_t>(rows), piece.data());
    piece_begin = first * row_bytes;
  }

  // Copies at most `size` bytes; returns how many, 0 at the end.
  size_t Read(char* to, size_t size) {
    const std::string& header = member->header;
    if (position == TotalBytes()) return 0;
    const char* from = nullptr;
    uint64_t there = 0;
    if (position < header.size()) {
      from = header.data() + position;
      there = header.size() - position;
    } else if (const uint64_t at = position - header.size(); member->fill) {
      if (at < piece_begin || at >= piece_begin + piece.size()) FillPiece(at);
      from = piece.data() + (at - piece_begin);
      there = piece_begin + piece.size() - at;
    } else {
      const void* data = member->data != nullptr ? member->data : member->copy.data();
      from = static_cast<const char*>(data) + at;
      there = member->size - at;
    }
    const size_t n = std::min<uint64_t>(size, there);
    std::memcpy(to, from, n);
    position += n;
    return n;
  }

  static zip_int64_t Call(void* user, void* data, zip_uint64_t size, zip_source_cmd_t command) {
    MemberSource* const source = static_cast<MemberSource*>(user);
    switch (command) {
      case ZIP_SOURCE_SUPPORTS:
        return ZIP_SOURCE_SUPPORTS_READABLE;
      case ZIP_SOURCE_OPEN:
        source->position = 0;
        return 0;
      case ZIP_SOURCE_READ:
        return source->writing->Guarded([&] {
          return static_cast<zip_int64_t>(source->Read(static_cast<char*>(data), size));
        });
      case ZIP_SOURCE_STAT: {
        zip_stat_t* const status = static_cast<zip_stat_t*>(data);
        zip_stat_init(status);
        status->size = status->comp_size = source->TotalBytes();
        status->comp_method = ZIP_CM_STORE;
        status->encryption_method = ZIP_EM_NONE;
        status->valid = ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE | ZIP_STAT_COMP_METHOD |
                        ZIP_STAT_ENCRYPTION_METHOD;
        return sizeof(zip_stat_t);
      }
      case ZIP_SOURCE_ERROR:
        return ReportFailure(data, size);
      default:
        return 0;
    }
  }
};

NpzWriter::NpzWriter() = default;
NpzWriter::~NpzWriter() = default;

void NpzWriter::AddBytes(const std::string& name, ArrayType type,
                         const std::vector<int64_t>& shape, const void* data,
                         NpzPacking packing) {
  AddRows(name, type, shape, nullptr, packing);
  members_.back().data = data;
}

void NpzWriter::AddRows(const std::string& name, ArrayType type,
                        const std::vector<int64_t>& shape, RowFunction fill,
                        NpzPacking packing) {
  uint64_t size = static_cast<uint64_t>(SizeOf(type));
  for (const int64_t axis : shape) size *= static_cast<uint64_t>(axis);
  const uint64_t rows = shape.empty() ? 1 : static_cast<uint64_t>(shape[0]);
  members_.push_back(
      {name, MakeNpyHeader(type, shape), "", nullptr, size, rows, std::move(fill), packing});
}

void NpzWriter::AddCopy(const std::string& name, ArrayType type,
                        const std::vector<int64_t>& shape, const void* data, size_t size) {
  AddRows(name, type, shape, nullptr, NpzPacking::kStore);
  members_.back().copy.assign(static_cast<const char*>(data), size);
}

void NpzWriter::WriteTo(const std::string& path) const {
  uint64_t expected = 0;
  for (const Member& member : members_) expected += member.size + kHeaderBytes;
  Writing writing{{path, expected}, nullptr};
  std::vector<MemberSource> sources;
  sources.reserve(members_.size());
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* target = zip_source_function_create(WriteArchive, &writing, &error);
  RequireZip(target != nullptr, "begin");
  zip_t* archive = zip_open_from_source(target, ZIP_TRUNCATE, &error);
  if (archive == nullptr) zip_source_free(target);
  RequireZip(archive != nullptr, "open");
  std::unique_ptr<zip_t, decltype(&zip_discard)> owner(archive, &zip_discard);
  for (const Member& member : members_) {
    sources.push_back({&member, &writing, 0, {}, 0});
    zip_source_t* source = zip_source_function(archive, MemberSource::Call, &sources.back());
    RequireZip(source != nullptr, "fill");
    const zip_int64_t index =
        zip_file_add(archive, (member.name + ".npy").c_str(), source, ZIP_FL_ENC_UTF_8);
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
  const bool closed = zip_close(archive) == 0;
  if (closed) owner.release();
  if (writing.failure != nullptr) std::rethrow_exception(writing.failure);
  RequireZip(closed, "finish");
  writing.file.Commit();
}

}  // namespace regrade
