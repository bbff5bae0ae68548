#include "pipeline/study/make_study.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/folder_listing.h"
#include "pipeline/files/json_file.h"
#include "pipeline/files/own_files.h"
#include "pipeline/report/html_text.h"
#include "pipeline/study/study_assets.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMostBytes = 200'000'000;
constexpr char kFilmOfRun[] = "styled.mp4";
constexpr int kChecks = 2;           // films that say they should be chosen
constexpr double kLeastSeconds = 3;  // a film is seen before it can be chosen

// "video/mp4" by the first bytes; empty for other files.
std::string TypeOf(const std::string& bytes) {
  if (bytes.size() > 12 && bytes.compare(4, 4, "ftyp") == 0) return "video/mp4";
  if (bytes.starts_with("\x1a\x45\xdf\xa3")) return "video/webm";
  return "";
}

bool IsFilm(const std::string& name) {
  const std::string ending = fs::path(name).extension().string();
  return ending == ".mp4" || ending == ".webm";
}

// Films of a method by the clip's name; a single film is the clip "film".
std::map<std::string, std::string> FilmsOf(const std::string& method) {
  if (!fs::is_directory(method)) return {{"film", method}};
  const std::string of_run = method + "/" + kFilmOfRun;
  RefuseForeign(of_run);
  if (fs::exists(of_run)) return {{"film", of_run}};
  std::map<std::string, std::string> films;
  for (const ListedFile& file : ListFolder(method).files)
    if (file.problem.empty() && IsFilm(file.name))
      films[fs::path(file.name).replace_extension().string()] = file.path;
  if (films.empty())
    throw InputError("there are no films here", method,
                     "give a film (.mp4, .webm), a folder of films or a run's folder");
  return films;
}

std::string NameOf(const std::string& method) {
  const fs::path path = fs::path(method).lexically_normal();
  const std::string name = (path.has_filename() ? path : path.parent_path()).stem().string();
  return name.empty() ? method : name;
}

std::vector<std::string> NamesOf(const std::vector<std::string>& methods,
                                 const std::vector<std::string>& given) {
  if (!given.empty() && given.size() != methods.size())
    throw UsageError(Concat(methods.size(), " methods, ", given.size(), " names"), "--name",
                     "give the option once for each method, or not at all");
  std::vector<std::string> names = given;
  if (names.empty())
    for (const std::string& method : methods) names.push_back(NameOf(method));
  if (std::set<std::string>(names.begin(), names.end()).size() != names.size())
    throw UsageError("two methods have one name: " + names[0], "--name", "name each method");
  return names;
}

void Replace(const std::string& mark, const std::string& by, std::string* text) {
  const size_t at = text->find(mark);
  REGRADE_CHECK(at != std::string::npos);
  text->replace(at, mark.size(), by);
}

}  // namespace

MadeStudy MakeStudy(const std::vector<std::string>& methods, const StudyOptions& options) {
  if (methods.size() < 2)
    throw UsageError("a study compares at least two methods", "regrade study",
                     "name their films");
  MadeStudy study;
  study.methods = NamesOf(methods, options.names);
  std::vector<std::map<std::string, std::string>> films;
  for (const std::string& method : methods) films.push_back(FilmsOf(method));
  for (size_t m = 1; m < methods.size(); ++m)
    for (const auto& [one, two] : {std::pair{m, size_t{0}}, std::pair{size_t{0}, m}})
      for (const auto& [clip, path] : films[one])
        if (!films[two].count(clip))
          throw InputError("there is no film of the clip " + clip, methods[two],
                           methods[one] + " has one");
  Hasher hasher;
  hasher.Add(options.protocol);
  hasher.Add(options.question);
  for (const std::string& name : study.methods) hasher.Add(name + "\n");
  uint64_t bytes_left = kMostBytes;
  JsonValue::Array clips;
  for (const auto& [clip, path] : films[0]) {
    JsonValue::Array encoded;
    std::string type;
    for (size_t m = 0; m < methods.size(); ++m) {
      const std::string& file = films[m].at(clip);
      const std::string bytes = ReadWholeFile(file, bytes_left);
      bytes_left -= bytes.size();
      const std::string own = TypeOf(bytes);
      if (own.empty())
        throw InputError("this is not a film that browsers play", file,
                         "convert it to MP4 (H.264) or WebM");
      if (!type.empty() && own != type)
        throw InputError("MP4 and WebM films of one clip", file, "convert them to one format");
      type = own;
      hasher.Add(bytes);
      encoded.push_back(Base64(bytes));
    }
    study.clips.push_back(clip);
    clips.push_back(
        JsonValue::Object{{"name", clip}, {"type", type}, {"films", std::move(encoded)}});
  }
  study.id = HashText(hasher.Value());
  JsonValue data = JsonValue::Object{
      {"id", study.id},
      {"protocol", options.protocol},
      {"question", options.question},
      {"methods", JsonValue::Array(study.methods.begin(), study.methods.end())},
      {"checks", kChecks},
      {"seconds", kLeastSeconds},
      {"clips", std::move(clips)}};
  std::string json;
  for (const char c : DumpJson(data, -1)) json += c == '<' ? "\\u003c" : std::string(1, c);
  study.html = kStudyTemplate;
  Replace("@CSS@", kStudyCss, &study.html);
  Replace("@SCRIPT@", kStudyScript, &study.html);
  Replace("@STUDY@", json, &study.html);
  return study;
}

}  // namespace regrade
