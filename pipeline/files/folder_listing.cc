#include "pipeline/files/folder_listing.h"

#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/base/natural_order.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

// Limits of the machine are no problem of the folder: its photos are not missing.
bool IsLack(const std::error_code& error) {
  return error == std::errc::io_error || error == std::errc::too_many_files_open ||
         error == std::errc::too_many_files_open_in_system ||
         error == std::errc::not_enough_memory;
}

[[noreturn]] void ThrowListError(const std::error_code& error, const fs::path& path) {
  throw Error(IsLack(error) ? ExitCode::kResources : ExitCode::kInput,
              "cannot list the folder: " + error.message(), path.string());
}

bool IsInside(const fs::path& path, const fs::path& root) {
  return std::mismatch(root.begin(), root.end(), path.begin(), path.end()).first == root.end();
}

const char* ProblemOf(fs::file_type type) {
  switch (type) {
    case fs::file_type::regular:
      return "";
    case fs::file_type::fifo:
      return "a named pipe, not a file";
    case fs::file_type::socket:
      return "a socket, not a file";
    default:
      return "a device, not a file";
  }
}

// Resolves a link; its problem is empty if the target is a regular file inside the folder.
ListedFile ResolveLink(const std::string& name, const fs::path& link, const fs::path& root) {
  std::error_code error;
  const fs::path target = fs::canonical(link, error);
  if (error) return {name, link.string(), "broken link: " + error.message()};
  if (!IsInside(target, root))
    return {name, link.string(), "a link that leads out of the folder (copy the file into it)"};
  const fs::file_type type = fs::status(target, error).type();
  if (type == fs::file_type::directory)
    return {name, link.string(), "a link to a folder that is listed anyway"};
  return {name, target.string(), ProblemOf(type)};
}

void ListInto(const fs::path& folder, const std::string& prefix, const fs::path& root,
              FolderListing* listing) {
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  if (error) {
    if (prefix.empty() || IsLack(error)) ThrowListError(error, folder);
    listing->files.push_back({prefix, folder.string(), "cannot list it: " + error.message()});
    return;
  }
  for (; entry != fs::directory_iterator(); entry.increment(error)) {
    const std::string base = entry->path().filename().string();
    if (base[0] == '.') {
      ++listing->hidden;
      continue;
    }
    const std::string name = prefix.empty() ? base : prefix + "/" + base;
    std::error_code status_error;
    const fs::file_type type = entry->symlink_status(status_error).type();
    if (status_error)
      listing->files.push_back({name, entry->path().string(), status_error.message()});
    else if (type == fs::file_type::symlink)
      listing->files.push_back(ResolveLink(name, entry->path(), root));
    else if (type == fs::file_type::directory && IsRunFolder(entry->path()))
      listing->runs.push_back(name);
    else if (type == fs::file_type::directory)
      ListInto(entry->path(), name, root, listing);
    else
      listing->files.push_back({name, entry->path().string(), ProblemOf(type)});
  }
  if (error) ThrowListError(error, folder);
}

}  // namespace

FolderListing ListFolder(const std::string& folder) {
  std::error_code error;
  const fs::path root = fs::canonical(folder, error);
  if (error) throw InputError("no such folder: " + error.message(), folder, "correct its name");
  if (!fs::is_directory(root, error))
    throw InputError("this is a file, not a folder", folder, "name the folder that has it");
  FolderListing listing;
  ListInto(root, "", root, &listing);
  std::ranges::sort(listing.files, NaturalLess, &ListedFile::name);
  std::ranges::sort(listing.runs, NaturalLess);
  return listing;
}

FolderListing ListNames(const std::string& folder, const std::set<std::string>& names) {
  FolderListing listing;
  for (const std::string& name : names) {
    const fs::path path = fs::path(folder) / name;
    std::error_code error;
    const fs::path target = fs::canonical(path, error);
    const fs::file_type type = error ? fs::file_type::none : fs::status(target, error).type();
    std::string problem = error ? error.message() : ProblemOf(type);
    if (type == fs::file_type::directory) problem = "a folder, not a file";
    listing.files.push_back({name, problem.empty() ? target.string() : path.string(), problem});
  }
  std::ranges::sort(listing.files, NaturalLess, &ListedFile::name);
  return listing;
}

bool IsRunFolder(const std::string& folder) {
  std::error_code error;
  return fs::is_directory(fs::path(folder) / ".regrade", error);
}

}  // namespace regrade
