// The one layer that writes result files: a reader sees the old file or the new one, never a
// torn one.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace regrade {

// Writes beside `path`, fsyncs, renames over it, fsyncs the folder. Throws Error(kResources)
// with the file, the bytes needed and the errno text; then the old file is untouched and the
// temporary removed.
void WriteFileAtomically(const std::string& path, std::string_view bytes);
// The same for `head` and `bytes` behind it: what is large need not be copied to stand behind a
// few words.
void WriteFileAtomically(const std::string& path, std::string_view head,
                         std::string_view bytes);

// Moves a finished file or folder of the same file system into place and makes that durable.
void RenameDurably(const std::string& from, const std::string& to);

// Throws what errno says of reading `path`: Error(kResources) if the drive failed or went away,
// else Error(kInput).
[[noreturn]] void ThrowReadError(const std::string& path);

// Whole file into memory. Throws Error(kInput) if it is missing, not a regular file, or above
// `max_bytes`.
std::string ReadWholeFile(const std::string& path, uint64_t max_bytes);

// Suffix of our temporaries, which a later run may delete: "<name>.regrade-tmp".
inline constexpr char kTemporarySuffix[] = ".regrade-tmp";

}  // namespace regrade
