#include "pipeline/page/view_session.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "kernels/base/error.h"
#include "pipeline/fields/network_checkpoint.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/files/own_files.h"
#include "pipeline/images/image_format.h"
#include "pipeline/page/field_codec.h"
#include "pipeline/page/keyframes.h"
#include "pipeline/page/make_page.h"
#include "pipeline/page/page_file.h"
#include "pipeline/page/style_codec.h"
#include "pipeline/report/html_text.h"
#include "pipeline/workspace/output_names.h"
#include "pipeline/workspace/style_folders.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

// Dropped pictures; a style's name has no dot in front.
constexpr char kPicturesFolder[] = "styles/.pictures";
constexpr uint64_t kMostFilmBytes = uint64_t{4} << 30;

HttpResponse Accepted(int job) {
  if (job == 0)
    return RefusedRequest(409, "another style or film is being made: wait, or cancel it");
  HttpResponse response;
  response.status = 202;
  response.body = DumpJson(JsonValue::Object{{"job", job}}, -1);
  return response;
}

// The path of `stem`, with a number behind it while `taken` says so.
template <typename Taken>
std::string FreePath(const std::string& folder, const std::string& stem, const Taken& taken) {
  std::string path = folder + "/" + stem;
  for (int k = 2; taken(path); ++k) path = Concat(folder, "/", stem, "-", k);
  return path;
}

}  // namespace

ViewSession::ViewSession(const std::string& folder, const std::vector<std::string>& style_flags)
    : folder_(folder), identity_(folder), style_flags_(style_flags) {}

void ViewSession::SayWhatIsAwaited(const std::string& text) {
  const std::lock_guard lock(mutex_);
  awaited_ = text;
}

void ViewSession::MakePageOf(const std::vector<std::string>& styles,
                             const ProgressFunction& progress) {
  const auto tell = [&](const Progress& part) {
    SayWhatIsAwaited(
        Format("The page is being made: %.0f %%", 100 * part.done / std::max(part.total, 1.0)));
    return Report(progress, part.done, part.total, part.note);
  };
  MadePage made = MakePage(folder_, styles, {.served = true}, tell);
  page_ = std::move(made.html);
  field_ = std::move(made.field);
  splats_ = std::move(made.places.splat);
  const std::lock_guard lock(mutex_);
  made_ = true;
}

std::optional<HttpResponse> ViewSession::NotYet(const std::string& target) const {
  const std::lock_guard lock(mutex_);
  if (made_) return std::nullopt;
  if (target != "/page") return RefusedRequest(503, "the page is not there yet");
  HttpResponse response;
  response.status = 202;
  response.body = DumpJson(JsonValue::Object{{"awaited", awaited_}}, -1);
  return response;
}

void ViewSession::CheckFolder() const {
  if (identity_.Holds()) return;
  throw ResourceError("the folder was moved or removed while its page was open", folder_,
                      "start `regrade view` again where it is now");
}

std::vector<Route> ViewSession::Routes() {
  const auto film = [this](const HttpRequest&) {
    const std::lock_guard lock(mutex_);
    if (film_.empty()) return RefusedRequest(404, "no film has been made");
    HttpResponse response;
    response.type = "video/mp4";
    response.body = ReadWholeFile(film_, kMostFilmBytes);
    return response;
  };
  const auto style = [this](const HttpRequest&) {
    const std::lock_guard lock(mutex_);
    if (style_.json.empty()) return RefusedRequest(404, "no style has been learned");
    HttpResponse response;
    response.body = style_.json;
    return response;
  };
  const auto codes = [this](const Served& style) {
    const std::lock_guard lock(mutex_);
    if (style.codes.empty()) return RefusedRequest(404, "no style has been learned");
    HttpResponse response;
    response.type = "application/octet-stream";
    response.body = style.codes;
    return response;
  };
  const auto page = [this](const HttpRequest&) {
    HttpResponse response;
    response.type = "text/html; charset=utf-8";
    response.body = page_;
    return response;
  };
  const auto cancel = [this](const HttpRequest&) {
    job_.Cancel();
    return JobState();
  };
  std::vector<Route> routes{
      {"GET", "/", 0, true, [this](const HttpRequest&) { return Opening(); }},
      {"GET", "/page", 0, false, page},
      {"POST", "/style", kMostPictureBytes, false,
       [this](const HttpRequest& request) { return TakePicture(request); }},
      {"POST", "/film", kMostPathBytes, false,
       [this](const HttpRequest& request) { return TakePath(request); }},
      {"GET", "/job", 0, false, [this](const HttpRequest&) { return JobState(); }},
      {"DELETE", "/job", 0, false, cancel},
      {"GET", "/learning", 0, false, [this](const HttpRequest&) { return StyleSoFar(); }},
      {"GET", "/learning/codes", 0, false,
       [this, codes](const HttpRequest&) { return codes(so_far_); }},
      {"GET", "/style", 0, false, style},
      {"GET", "/style/codes", 0, false,
       [this, codes](const HttpRequest&) { return codes(style_); }},
      {"GET", "/film", 0, false, film}};
  for (Route& route : routes)
    if (route.target != "/")  // which holds nothing of the scene
      route.answer = [this, target = route.target,
                      answer = std::move(route.answer)](const HttpRequest& request) {
        const std::optional<HttpResponse> not_yet = NotYet(target);
        return not_yet ? *not_yet : answer(request);
      };
  return routes;
}

// It holds nothing of the scene: whoever lacks the token sees an empty page.
HttpResponse ViewSession::Opening() const {
  HttpResponse response;
  response.type = "text/html; charset=utf-8";
  response.body = OpeningHtml();
  response.policy = OpeningPolicy();
  return response;
}

HttpResponse ViewSession::TakePicture(const HttpRequest& request) {
  const ImageFormat* const format = SniffImageFormat(request.body, "");
  if (format == nullptr || IsVideo(*format))
    return RefusedRequest(415, "this file is no picture");
  if (job_.Running()) return Accepted(0);
  CheckFolder();
  const std::string pictures = folder_ + "/" + kPicturesFolder;
  RefuseForeign(folder_ + "/" + kStylesFolder);
  RefuseForeignBelow(pictures);
  MakeFolder(pictures);
  // What a file is, its first bytes say: its ending is left out. A picture that comes again is
  // the same file, and gives the same style.
  const std::string picture =
      FreePath(pictures, SafeStyleName(request.name), [&request](const std::string& path) {
        return fs::exists(path) && ReadWholeFile(path, kMostPictureBytes) != request.body;
      });
  if (!fs::exists(picture)) WriteFileAtomically(picture, request.body);
  const std::string name = NameStyles(folder_, {picture}, "")[0].name;
  learning_ = StyleFolder(folder_, name);
  step_ = -1;
  std::vector<std::string> words = {"stylize", folder_, "--style", picture,
                                    "--name",  name,    "--until", "stylize"};
  words.insert(words.end(), style_flags_.begin(), style_flags_.end());
  return Accepted(job_.Start("style", words, [this, name, folder = learning_] {
    Served style = Serve(ReadNetworkFile(folder + "/network.npz"), PageStyleId(folder), name);
    const std::lock_guard lock(mutex_);
    style_ = std::move(style);
  }));
}

HttpResponse ViewSession::StyleSoFar() {
  const auto nothing = [] { return HttpResponse{.status = 204}; };
  if (!job_.Running() || learning_.empty()) return nothing();
  const auto bytes = Workspace::PeekCheckpoint(learning_, "stylize");
  const auto state = bytes ? UnpackTrainingState(*bytes) : std::nullopt;
  if (!state || state->step == step_) return nothing();
  step_ = state->step;
  HttpResponse response;
  so_far_ = Serve({LipschitzNetwork(state->network), 0, field_.background}, "learning",
                  fs::path(learning_).filename().string());
  response.body = so_far_.json;
  return response;
}

HttpResponse ViewSession::TakePath(const HttpRequest& request) {
  ParseKeyframePath(request.body, "camera_path.json");
  if (job_.Running()) return Accepted(0);
  CheckFolder();
  const std::string films = folder_ + "/" + kFilmsFolder;
  RefuseForeignBelow(films);
  MakeFolder(films);
  const std::string path =
      FreePath(films, "film",
               [](const std::string& taken) {
                 return fs::exists(taken + ".json") || fs::exists(taken + ".mp4");
               }) +
      ".json";
  WriteFileAtomically(path, request.body);
  learning_.clear();
  return Accepted(job_.Start("film", {"render", folder_, "--path", path}, [this, path] {
    const std::lock_guard lock(mutex_);
    film_ = fs::path(path).replace_extension(".mp4").string();
  }));
}

HttpResponse ViewSession::JobState() const {
  const JobStatus status = job_.Status();
  HttpResponse response;
  response.body = DumpJson(JsonValue::Object{{"job", status.number},
                                             {"kind", status.kind},
                                             {"state", status.state},
                                             {"stage", status.stage},
                                             {"part", status.part},
                                             {"note", status.note},
                                             {"error", status.error}},
                           -1);
  return response;
}

ViewSession::Served ViewSession::Serve(const StoredNetwork& network, const std::string& id,
                                       const std::string& name) const {
  PageStyle style = EncodeStyle(network, field_, 1);
  style.header["id"] = id;
  style.header["name"] = name;
  style.header["weights"] = Base64(style.packed);
  return {DumpJson(style.header, -1), StyledWords(style, splats_)};
}

}  // namespace regrade
