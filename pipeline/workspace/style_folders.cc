#include "pipeline/workspace/style_folders.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <string_view>
#include <thread>

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "kernels/base/natural_order.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/files/own_files.h"
#include "pipeline/files/text.h"
#include "pipeline/workspace/folder_lock.h"
#include "pipeline/workspace/output_names.h"
#include "pipeline/workspace/stage_record.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr char kLastStyle[] = "/.regrade/last_style.json";
constexpr uint64_t kMaxFilm = uint64_t{16} << 30;

bool IsSafe(char c) {
  constexpr std::string_view kOthers = "-_.";
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
         kOthers.find(c) != std::string_view::npos;
}

// Of the picture that a folder styles/NAME belongs to; empty for a folder without a run.
std::string PictureHashOf(const std::string& folder, const std::string& name) {
  const std::string path = StyleFolder(folder, name) + "/run.json";
  if (!fs::is_regular_file(path)) return "";
  const JsonValue run = ReadJsonFile(path);
  const JsonValue* hash = run.Find(kPictureHash);
  return hash != nullptr && hash->IsString() ? hash->AsString() : "";
}

}  // namespace

std::string SafeStyleName(const std::string& picture) {
  std::string name = fs::path(picture).stem().string();
  // Bytes of a character beyond ASCII give one '_'.
  std::string safe;
  for (const char c : name) {
    const bool continues = (static_cast<unsigned char>(c) & 0xc0) == 0x80;
    if (!continues) safe += IsSafe(c) ? c : '_';
  }
  safe.erase(0, std::min(safe.size(), safe.find_first_not_of('.')));
  constexpr size_t kLongest = 80;  // a folder's name may have 255 bytes
  if (safe.size() > kLongest) safe.resize(kLongest);
  return safe.empty() ? "style" : safe;
}

std::string StyleFolder(const std::string& folder, const std::string& name) {
  const std::string styles = folder + "/" + kStylesFolder, path = styles + "/" + name;
  RefuseForeign(styles);
  RefuseForeign(path);
  return path;
}

std::string PicturesHash(const std::vector<std::string>& pictures) {
  if (pictures.size() == 1) return HashFile(pictures[0]);
  std::string all;
  for (const std::string& picture : pictures) all += HashFile(picture) + "\n";
  return HashText(HashOf(all));
}

std::vector<NamedStyle> NameStyles(const std::string& folder,
                                   const std::vector<std::string>& pictures,
                                   const std::string& name, bool together) {
  if (!name.empty() && pictures.size() > 1 && !together)
    throw UsageError("names one style, and there are several pictures", "--name",
                     "give one --style, or leave --name out");
  if (!name.empty() && SafeStyleName(name + ".x") != name)
    throw UsageError("'" + name + "' is not allowed", "--name",
                     "use letters, digits, '-', '_' and '.', not first; for example " +
                         SafeStyleName(name + ".x"));
  std::vector<NamedStyle> styles;
  std::vector<std::string> hashes;
  for (const std::string& picture : pictures) {
    hashes.push_back(HashFile(picture));
    if (std::ranges::find(hashes, hashes.back()) != hashes.end() - 1)
      throw UsageError("this picture is given twice", picture, "leave one of them out");
  }
  for (size_t i = 0; i < pictures.size() && !(together && i > 0); ++i) {
    const std::vector<std::string> own =
        together ? pictures : std::vector<std::string>{pictures[i]};
    const std::string hash = PicturesHash(own);
    const auto taken = [&](const std::string& wanted) {
      if (std::ranges::find(styles, wanted, &NamedStyle::name) != styles.end()) return true;
      const std::string of_folder = PictureHashOf(folder, wanted);
      return !of_folder.empty() && of_folder != hash;
    };
    if (!name.empty() && taken(name))
      throw UsageError("style '" + name + "' belongs to another picture", "--name",
                       "choose another name");
    std::string stem = name;
    for (size_t k = 0; name.empty() && k < own.size(); ++k)
      stem += (k > 0 ? "-" : "") + SafeStyleName(own[k]);
    std::string free = stem;
    for (int k = 2; taken(free); ++k) free = stem + "-" + std::to_string(k);
    styles.push_back({free, own});
  }
  return styles;
}

std::vector<std::string> StyleNames(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator it(folder + "/" + kStylesFolder, error), end; !error && it != end;
       it.increment(error))
    if (fs::is_directory(it->symlink_status(error)) &&
        fs::is_regular_file(it->path() / "run.json", error))
      names.push_back(it->path().filename().string());
  std::ranges::sort(names, NaturalLess);
  return names;
}

bool IsLearned(const std::string& folder, const std::string& name) {
  const std::string style = StyleFolder(folder, name);
  return fs::is_regular_file(style + "/network.npz") &&
         (fs::is_regular_file(style + "/.regrade/stages/stylize.json") ||
          !fs::exists(style + "/.regrade"));
}

std::vector<std::string> LearnedStyles(const std::string& folder,
                                       std::vector<std::string>* left) {
  std::vector<std::string> learned;
  for (const std::string& name : StyleNames(folder))
    if (IsLearned(folder, name))
      learned.push_back(name);
    else if (left != nullptr)
      left->push_back(name);
  return learned;
}

std::string LeftOutText(const std::string& folder, const std::vector<std::string>& left) {
  if (left.empty()) return "";
  return "left out: " + Join(left, ", ") + (left.size() == 1 ? " is" : " are") +
         " not finished; `regrade stylize " + folder + " --name NAME` goes on";
}

std::string ChosenStyle(const std::string& folder, const std::string& name) {
  const std::vector<std::string> names = StyleNames(folder);
  if (names.empty())
    throw InputError("has no styles", folder,
                     "make one with `regrade stylize " + folder + " --style PICTURE`");
  const auto known = [&names](const std::string& style) {
    return std::ranges::find(names, style) != names.end();
  };
  std::string chosen = name;
  if (chosen.empty() && fs::is_regular_file(folder + kLastStyle)) {
    const std::string last = ReadJsonFile(folder + kLastStyle).At("name").AsString();
    if (known(last)) chosen = last;  // its folder may have been deleted
  }
  const std::vector<std::string> learned = LearnedStyles(folder);
  if (chosen.empty() && learned.size() == 1) chosen = learned[0];
  if (chosen.empty() && names.size() == 1) chosen = names[0];
  if (!chosen.empty() && SafeStyleName(chosen + ".x") == chosen)
    StyleFolder(folder, chosen);  // refuses a link, which is not among the names
  if (!known(chosen))
    throw InputError(chosen.empty() ? "several styles, and none was finished last"
                                    : "has no style '" + chosen + "'",
                     folder, "its styles, for --name: " + Join(names, ", "));
  return chosen;
}

std::string ChosenLearnedStyle(const std::string& folder, const std::string& name) {
  const std::string chosen = ChosenStyle(folder, name);
  if (IsLearned(folder, chosen)) return chosen;
  const std::vector<std::string> learned = LearnedStyles(folder);
  throw InputError("style '" + chosen + "' is not finished", folder,
                   "go on with `regrade stylize " + folder + " --name " + chosen + "`" +
                       (learned.empty() ? "" : ", or name one of " + Join(learned, ", ")));
}

void CheckResults(const std::string& folder, const std::vector<std::string>& styles) {
  Workspace::CheckResults(folder, {"pose", "reconstruct"});
  for (const std::string& style : styles)
    Workspace::CheckResults(StyleFolder(folder, style), {"stylize"});
}

namespace {

// Two styles may be finished at the same moment.
FolderLock WaitForLock(const std::string& path) {
  constexpr int kTries = 300;
  for (int i = 1;; ++i) {
    try {
      return FolderLock(path, LockUse::kAlone);
    } catch (const Error& error) {
      if (error.code() != ExitCode::kFolderInUse || i == kTries) throw;
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  }
}

}  // namespace

void PublishStyle(const std::string& folder, const std::string& name) {
  const FolderLock lock = WaitForLock(folder + "/.regrade/publish.lock");
  const std::string film = StyleFolder(folder, name) + "/" + kStyledFilm,
                    copy = folder + "/" + kStyledFilm;
  std::error_code error;
  if (!fs::is_regular_file(film))
    fs::remove(copy, error);  // it would be another style's
  else if (!fs::is_regular_file(copy) || HashFile(film) != HashFile(copy))
    WriteFileAtomically(copy, ReadWholeFile(film, kMaxFilm));
  WriteJsonFile(folder + kLastStyle, JsonValue::Object{{"name", name}});
}

}  // namespace regrade
