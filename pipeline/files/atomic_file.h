// Writes result files so that a reader sees the old file or the new one, never a part of it.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "kernels/base/file_descriptor.h"

namespace regrade {

// A file under construction. Bytes go to a temporary beside `path`; Commit() makes them durable
// and renames the temporary over `path`. Without Commit() the old file stays and the temporary
// is removed. All calls throw Error(kResources) with the file, `bytes` (the size to expect) and
// the errno text.
class AtomicFile {
 public:
  AtomicFile(const std::string& path, uint64_t bytes);
  ~AtomicFile();

  void Write(const void* data, size_t size);
  void Seek(uint64_t position);  // where the next Write begins
  uint64_t position() const { return position_; }
  uint64_t size() const { return size_; }
  // Flushes, fsyncs, closes, renames, and fsyncs the folder.
  void Commit();

 private:
  void WriteThrough(const char* data, size_t size);
  void Flush();

  std::string path_, temporary_;
  uint64_t bytes_;
  FileDescriptor fd_;
  uint64_t position_ = 0, size_ = 0;
  std::string pending_;  // bytes before position_ that are not written yet
  bool committed_ = false;
};

// Whole contents at once, through an AtomicFile.
void WriteFileAtomically(const std::string& path, std::string_view bytes);
// One piece after the other, without a copy that joins them.
void WriteFileAtomically(const std::string& path, const std::vector<std::string_view>& pieces);

// Makes a finished file durable. Throws Error(kResources).
void SyncFile(const std::string& path);

// Moves a finished file or folder of the same file system into place and makes that durable.
void RenameDurably(const std::string& from, const std::string& to);

// Throws an Error for a failed read of `path`, by errno: kResources if the drive failed or went
// away or a limit of the system was met, else kInput.
[[noreturn]] void ThrowReadError(const std::string& path);

// Opens a regular file for reading; a named pipe or device is never waited for. Throws
// Error(kInput) if it is missing or not a regular file, kResources as ThrowReadError. `size`
// (may be null) gets its size.
int OpenToRead(const std::string& path, uint64_t* size);

// Whole file into memory. Throws as OpenToRead, and Error(kInput) if it is above `max_bytes`.
std::string ReadWholeFile(const std::string& path, uint64_t max_bytes);

// Suffix of our temporaries, which a later run may delete: "<name>.regrade-tmp".
inline constexpr char kTemporarySuffix[] = ".regrade-tmp";

}  // namespace regrade
