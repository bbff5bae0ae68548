// Layout: APPNOTE.TXT 6.3.9 of PKWARE, sections 4.3.7 (local header), 4.3.12 (central header),
// 4.3.14-16 (ends of the directory), 4.5.3 (64-bit sizes).
#include "pipeline/files/zip_directory.h"

#include <algorithm>
#include <set>
#include <string_view>

#include "kernels/base/checked_math.h"
#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr uint32_t kLocalMark = 0x04034b50, kCentralMark = 0x02014b50, kEndMark = 0x06054b50,
                   kEnd64Mark = 0x06064b50, kLocator64Mark = 0x07064b50;
constexpr uint64_t kMaxMembers = 10000;
constexpr uint64_t kMaxDirectory = 16 << 20;
constexpr uint64_t kLocalBytes = 30, kCentralBytes = 46, kEndBytes = 22;
constexpr uint64_t kMaxComment = 65535;
constexpr uint64_t kMaxRatio = 1032;

uint64_t Little(std::string_view bytes, size_t at, int size) {
  uint64_t value = 0;
  for (int i = size; i-- > 0;)
    value = value << 8 | static_cast<unsigned char>(bytes[at + static_cast<size_t>(i)]);
  return value;
}

struct Header {
  uint64_t flags, method, crc, compressed, bytes, offset;
};

class DirectoryReader {
 public:
  DirectoryReader(uint64_t file_bytes, const ReadAt& read_at, const std::string& where)
      : file_bytes_(file_bytes), read_at_(read_at), where_(where) {}

  std::vector<ZipMember> Read();

 private:
  [[noreturn]] void Refuse(const std::string& why) const {
    throw Error(ExitCode::kInput, "zip archive: " + why, where_,
                "the file is damaged or was made to do harm");
  }
  std::string Bytes(uint64_t offset, uint64_t size) const {
    const auto end = CheckedAdd(offset, size);
    if (!end || *end > file_bytes_)
      Refuse("bytes " + std::to_string(offset) + " + " + std::to_string(size) +
             " lie outside the file of " + std::to_string(file_bytes_));
    std::string bytes(size, '\0');
    if (size > 0) read_at_(offset, bytes.data(), bytes.size());
    return bytes;
  }
  void FindDirectory();
  void ReadEnd64(uint64_t end_offset);
  // Replaces 32-bit sentinels by the 64-bit values of the extra field.
  void Widen(std::string_view extra, bool sizes_always, Header* header) const;
  void CheckLocal(const Header& central, ZipMember* member, uint64_t* begin,
                  uint64_t* end) const;

  const uint64_t file_bytes_;
  const ReadAt& read_at_;
  const std::string& where_;
  uint64_t count_ = 0, directory_offset_ = 0, directory_bytes_ = 0;
};

void DirectoryReader::FindDirectory() {
  if (file_bytes_ < kEndBytes) Refuse("too short");
  const uint64_t tail_bytes = std::min(file_bytes_, kEndBytes + kMaxComment);
  const uint64_t tail_offset = file_bytes_ - tail_bytes;
  const std::string tail = Bytes(tail_offset, tail_bytes);
  for (uint64_t at = tail_bytes - kEndBytes + 1; at-- > 0;) {
    if (Little(tail, at, 4) != kEndMark) continue;
    if (Little(tail, at + 20, 2) != tail_bytes - kEndBytes - at) continue;
    if (Little(tail, at + 4, 2) != 0 || Little(tail, at + 6, 2) != 0 ||
        Little(tail, at + 8, 2) != Little(tail, at + 10, 2))
      Refuse("it is in several parts");
    count_ = Little(tail, at + 10, 2);
    directory_bytes_ = Little(tail, at + 12, 4);
    directory_offset_ = Little(tail, at + 16, 4);
    const uint64_t end_offset = tail_offset + at;
    if (count_ == 0xffff || directory_bytes_ == 0xffffffff || directory_offset_ == 0xffffffff)
      ReadEnd64(end_offset);
    const auto end = CheckedAdd(directory_offset_, directory_bytes_);
    if (!end || *end > end_offset) Refuse("the directory does not fit into the file");
    return;
  }
  Refuse("it has no directory");
}

void DirectoryReader::ReadEnd64(uint64_t end_offset) {
  if (end_offset < 20) Refuse("no room for its 64-bit directory");
  const std::string locator = Bytes(end_offset - 20, 20);
  if (Little(locator, 0, 4) != kLocator64Mark) return;  // the plain values are meant
  const std::string end = Bytes(Little(locator, 8, 8), 56);
  if (Little(end, 0, 4) != kEnd64Mark) Refuse("its 64-bit directory is not where it says");
  if (Little(end, 16, 4) != 0 || Little(end, 20, 4) != 0 ||
      Little(end, 24, 8) != Little(end, 32, 8))
    Refuse("it is in several parts");
  count_ = Little(end, 32, 8);
  directory_bytes_ = Little(end, 40, 8);
  directory_offset_ = Little(end, 48, 8);
}

void DirectoryReader::Widen(std::string_view extra, bool sizes_always, Header* header) const {
  for (size_t at = 0; at + 4 <= extra.size();) {
    const uint64_t id = Little(extra, at, 2), size = Little(extra, at + 2, 2);
    if (size > extra.size() - at - 4) Refuse("an extra field is longer than its room");
    if (id == 1) {
      size_t next = at + 4;
      const size_t end = next + size;
      const auto widen = [&](uint64_t* value) {
        if (*value != 0xffffffff) return;
        if (end - next < 8) Refuse("a 64-bit size is missing");
        *value = Little(extra, next, 8);
        next += 8;
      };
      widen(&header->bytes);
      widen(&header->compressed);
      if (!sizes_always) widen(&header->offset);
    }
    at += 4 + size;
  }
}

void DirectoryReader::CheckLocal(const Header& central, ZipMember* member, uint64_t* begin,
                                 uint64_t* end) const {
  const std::string fixed = Bytes(central.offset, kLocalBytes);
  const uint64_t name_bytes = Little(fixed, 26, 2), extra_bytes = Little(fixed, 28, 2);
  const std::string rest = Bytes(central.offset + kLocalBytes, name_bytes + extra_bytes);
  Header local{Little(fixed, 6, 2),  Little(fixed, 8, 2),  Little(fixed, 14, 4),
               Little(fixed, 18, 4), Little(fixed, 22, 4), 0};
  Widen(std::string_view(rest).substr(name_bytes), true, &local);
  const bool sizes_follow = (local.flags & 8) != 0;  // a data descriptor behind the data
  const bool same_sizes = local.crc == central.crc && local.compressed == central.compressed &&
                          local.bytes == central.bytes;
  const bool no_sizes = local.crc == 0 && local.compressed == 0 && local.bytes == 0;
  if (Little(fixed, 0, 4) != kLocalMark ||
      std::string_view(rest).substr(0, name_bytes) != member->name ||
      local.method != central.method || (local.flags & 1) != (central.flags & 1) ||
      !(same_sizes || (sizes_follow && no_sizes)))
    Refuse("two descriptions of '" + member->name + "' disagree");
  member->data_offset = central.offset + kLocalBytes + name_bytes + extra_bytes;
  *begin = central.offset;
  const auto last = CheckedAdd(member->data_offset, central.compressed);
  if (!last || *last > directory_offset_)
    Refuse("'" + member->name + "' runs into the directory");
  *end = *last;
}

std::vector<ZipMember> DirectoryReader::Read() {
  FindDirectory();
  if (count_ > kMaxMembers || directory_bytes_ > kMaxDirectory ||
      count_ * kCentralBytes > directory_bytes_)
    Refuse("a directory of " + std::to_string(count_) + " members in " +
           std::to_string(directory_bytes_) + " bytes");
  const std::string directory = Bytes(directory_offset_, directory_bytes_);

  std::vector<ZipMember> members;
  std::vector<std::pair<uint64_t, uint64_t>> ranges;
  std::set<std::string> names;
  size_t at = 0;
  for (uint64_t i = 0; i < count_; ++i) {
    if (directory.size() - at < kCentralBytes || Little(directory, at, 4) != kCentralMark)
      Refuse("entry " + std::to_string(i) + " of the directory is damaged");
    Header header{Little(directory, at + 8, 2),  Little(directory, at + 10, 2),
                  Little(directory, at + 16, 4), Little(directory, at + 20, 4),
                  Little(directory, at + 24, 4), Little(directory, at + 42, 4)};
    const uint64_t name_bytes = Little(directory, at + 28, 2);
    const uint64_t extra_bytes = Little(directory, at + 30, 2);
    const uint64_t comment_bytes = Little(directory, at + 32, 2);
    if (name_bytes + extra_bytes + comment_bytes > directory.size() - at - kCentralBytes)
      Refuse("entry " + std::to_string(i) + " is longer than the directory");
    ZipMember member;
    member.name = directory.substr(at + kCentralBytes, name_bytes);
    Widen(std::string_view(directory).substr(at + kCentralBytes + name_bytes, extra_bytes),
          false, &header);
    if (header.flags & 1) Refuse("'" + member.name + "' is encrypted");
    if (header.method != 0 && header.method != 8)
      Refuse("'" + member.name + "' is packed by method " + std::to_string(header.method) +
             "; 0 and 8 are read");
    if (!names.insert(member.name).second) Refuse("'" + member.name + "' appears twice");
    member.method = static_cast<int>(header.method);
    member.compressed_bytes = header.compressed;
    member.bytes = header.bytes;
    if (header.method == 0 && header.bytes != header.compressed)
      Refuse("'" + member.name + "' is stored, but its two sizes differ");
    if (header.bytes / kMaxRatio > header.compressed)
      Refuse("'" + member.name + "' claims " + std::to_string(header.bytes) + " bytes out of " +
             std::to_string(header.compressed) + ", more than deflate can do");
    uint64_t begin = 0, end = 0;
    CheckLocal(header, &member, &begin, &end);
    ranges.emplace_back(begin, end);
    members.push_back(std::move(member));
    at += kCentralBytes + name_bytes + extra_bytes + comment_bytes;
  }
  std::sort(ranges.begin(), ranges.end());
  for (size_t i = 1; i < ranges.size(); ++i)
    if (ranges[i].first < ranges[i - 1].second) Refuse("two members share bytes");
  return members;
}

}  // namespace

std::vector<ZipMember> ReadZipDirectory(uint64_t file_bytes, const ReadAt& read_at,
                                        const std::string& where) {
  return DirectoryReader(file_bytes, read_at, where).Read();
}

}  // namespace regrade
