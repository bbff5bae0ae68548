#include "pipeline/page/page_file.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "pipeline/page/page_assets.h"
#include "pipeline/report/html_text.h"
#include "pipeline/report/picture.h"

namespace regrade {
namespace {

double ToNineDigits(double value) { return std::round(value * 1e9) / 1e9; }

template <typename T>
JsonValue::Array ArrayOf(const Vec3<T>& v) {
  return {ToNineDigits(v.x), ToNineDigits(v.y), ToNineDigits(v.z)};
}

JsonValue CameraJson(const Camera& camera) {
  JsonValue::Array rotation;
  for (const Vec3d& row : camera.camera_from_world.rotation.row)
    for (int a = 0; a < 3; ++a) rotation.push_back(ToNineDigits(row[a]));
  return JsonValue::Object{
      {"center", ArrayOf(camera.Center())}, {"fx", ToNineDigits(camera.fx)},
      {"fy", ToNineDigits(camera.fy)},      {"height", camera.height},
      {"rotation", std::move(rotation)},    {"width", camera.width}};
}

// "sha256-...": the hash of a policy, from hexadecimal digits.
std::string PolicyHash(const std::string& digits) {
  std::string bytes;
  for (size_t i = 0; i < digits.size(); i += 2)
    bytes += static_cast<char>(std::stoi(digits.substr(i, 2), nullptr, 16));
  return "'sha256-" + Base64(bytes) + "'";
}

std::string JpegUrl(const std::string& jpeg) { return DataUrl({jpeg, 0, 0}); }

// JSON in an element: no text may end it.
std::string InElement(std::string json) {
  for (size_t at = 0; (at = json.find('<', at)) != std::string::npos;)
    json.replace(at, 1, "\\u003c");
  return json;
}

JsonValue Header(const PageContent& content, const PageCheck* check) {
  JsonValue header = content.field.header;
  const Camera& first = content.cameras.at(0);
  header["home"] = content.home;
  Vec3d up{};
  JsonValue::Array cameras;
  for (const Camera& camera : content.cameras) {
    up += camera.Up();
    cameras.push_back(CameraJson(camera));
  }
  header["cameras"] = std::move(cameras);
  header["up"] = ArrayOf(Norm(up) > 1e-6 ? Normalized(up) : first.Up());
  JsonValue::Array photos, styles;
  for (const PagePhoto& photo : content.photos) {
    JsonValue entry =
        JsonValue::Object{{"camera", photo.camera}, {"picture", JpegUrl(photo.jpeg)}};
    if (!photo.name.empty()) entry["name"] = photo.name;
    photos.push_back(std::move(entry));
  }
  for (size_t i = 0; i < content.styles.size(); ++i) {
    JsonValue style = content.styles[i].header;
    style["picture"] = JpegUrl(content.style_pictures.at(i));
    styles.push_back(std::move(style));
  }
  JsonValue::Array covariance;
  for (const Vec3d& row : content.colors.covariance.row)
    for (int a = 0; a < 3; ++a) covariance.push_back(row[a]);
  header["colors"] = JsonValue::Object{{"mean", ArrayOf(content.colors.mean)},
                                       {"covariance", std::move(covariance)}};
  header["photos"] = std::move(photos);
  header["styles"] = std::move(styles);
  header["check"] =
      check == nullptr
          ? JsonValue()
          : JsonValue(JsonValue::Object{{"views", check->views},
                                        {"worst_db", ToNineDigits(check->worst_db)}});
  return header;
}

std::string PagePolicy(const std::string& scripts, bool served) {
  return "default-src 'none'; base-uri 'none'; form-action 'none'; img-src data:; worker-src "
         "blob:; script-src 'wasm-unsafe-eval' " +
         scripts + "; style-src " + PolicyHash(kPageCssHash) +
         (served ? "; connect-src 'self'" : "");
}

}  // namespace

std::string OpeningHtml() {
  std::string html = kOpenTemplate;
  const std::string place = "@JS@";
  return html.replace(html.find(place), place.size(), kOpenScript);
}

std::string OpeningPolicy() {
  return PagePolicy(PolicyHash(kOpenScriptHash) + " " + PolicyHash(kPageScriptHash), true);
}

std::string PageHtml(const PageContent& content, const PageCheck* check) {
  std::string sections;
  const auto add = [&](const std::string& name, const std::string& packed) {
    sections += "<script type=\"application/octet-stream\" id=\"" + name + "\">" +
                Base64(packed) + "</script>\n";
  };
  for (const PageSection& section : content.field.sections) add(section.name, section.packed);
  for (size_t i = 0; i < content.styles.size(); ++i)
    add("network_" + std::to_string(i), content.styles[i].packed);
  for (size_t i = 0; i < content.styles.size(); ++i)
    if (const std::string& residual = content.styles[i].residual; !residual.empty())
      add("residual_" + std::to_string(i), residual);
  const std::string policy = PagePolicy(PolicyHash(kPageScriptHash), content.served);
  const std::string scene = InElement(DumpJson(Header(content, check), -1));
  const std::pair<const char*, std::string> parts[] = {
      {"@CSP@", policy},  {"@CSS@", kPageCss},      {"@POSTER@", JpegUrl(content.poster)},
      {"@SCENE@", scene}, {"@SECTIONS@", sections}, {"@JS@", kPageScript}};
  std::string_view rest = kPageTemplate;
  std::string html;
  for (const auto& [place, text] : parts) {  // in the template's order
    const size_t at = rest.find(place);
    REGRADE_CHECK(at != std::string_view::npos);
    html += rest.substr(0, at);
    html += text;
    rest.remove_prefix(at + std::string_view(place).size());
  }
  return html += rest;
}

int HomeCamera(const std::vector<Camera>& cameras) {
  Vec3d center{}, forward{};
  for (const Camera& camera : cameras) {
    center += camera.Center() / static_cast<double>(cameras.size());
    forward += camera.Forward() / static_cast<double>(cameras.size());
  }
  double size = 1e-9;
  for (const Camera& camera : cameras) size = std::max(size, Norm(camera.Center() - center));
  int best = 0;
  double least = 1e300;
  for (size_t i = 0; i < cameras.size(); ++i) {
    const double far =
        Norm(cameras[i].Center() - center) / size - Dot(cameras[i].Forward(), forward);
    if (far < least) least = far, best = static_cast<int>(i);
  }
  return best;
}

}  // namespace regrade
