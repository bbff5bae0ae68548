// Writes small pages of splats, and what this program renders of them:
// write_scene_pages FOLDER [RUN STYLE]. For tests that open them in a browser. With an output
// folder and one of its styles only that page is written, with pictures of the checked views.
//
// FOLDER/NAME.html, and FOLDER/NAME.json: views with the page's lens, place and weights, and
// their pixels, RGB of 8 bits in base64, of the field and the style as the page has them.
// FOLDER/camera_path.json, and places.json: what this program computes along it; colors.json:
// its colour maps.
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "kernels/base/random.h"
#include "kernels/field/pad_sh_basis.h"
#include "kernels/render/field_renderer.h"
#include "kernels/scene/facing.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/network_file.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/page/check_page.h"
#include "pipeline/page/keyframes.h"
#include "pipeline/page/make_page.h"
#include "pipeline/page/page_file.h"
#include "pipeline/report/html_text.h"
#include "pipeline/workspace/style_folders.h"
#include "stylize/field/blend_fields.h"
#include "stylize/image/monge_kantorovich.h"
#include "stylize/training/initial_network.h"
#include "tests/support/keyframes.h"
#include "tests/support/pinhole.h"
#include "tests/support/small_splats.h"

namespace regrade {
namespace {

constexpr int kWidth = 48, kHeight = 36;

Camera LookingAt(const Vec3d& eye, const Vec3d& at, double focal) {
  Camera camera = testing::PinholeOf(kWidth, kHeight, focal);
  const Vec3d ahead = Normalized(at - eye), right = Normalized(Cross(ahead, {0, 0, 1}));
  camera.camera_from_world = Facing(eye, ahead, right);
  return camera;
}

// Around the box of the splats, and one inside it.
std::vector<Camera> PageCameras() {
  return {LookingAt({2.4, 0.3, 0.5}, {0.1, -0.2, 0}, 50),
          LookingAt({-1.9, 1.5, 0.9}, {0, -0.1, 0.1}, 60),
          LookingAt({0.3, -0.3, 0.1}, {-0.4, 0.5, 0.3}, 30)};
}

StoredNetwork Style() {
  StoredNetwork style;
  style.network.data().sh_scale = 0.5f;
  style.network.data().omega = 1;
  InitializeAsPyTorch(7, &style.network);
  style.network.data().has_base = true;
  style.network.data().base.matrix.row[0] = {0.3, 0.6, 0.1};
  style.network.data().base.offset = {0.05, 0.1, -0.05};
  style.background = {0.1f, 0.2f, 0.5f};
  return style;
}

std::string Pixels(const Image& image) {
  std::string bytes;
  for (const float value : image.pixels)
    bytes += static_cast<char>(static_cast<int>(std::floor(value * 255 + 0.5f)));
  return Base64(bytes);
}

JsonValue ViewJson(const Camera& camera, double weight, const RadianceField& field) {
  JsonValue::Array rotation, eye;
  const Mat3d from_camera = camera.camera_from_world.rotation.Transposed();
  for (const Vec3d& row : from_camera.row)
    for (int a = 0; a < 3; ++a) rotation.push_back(row[a]);
  for (int a = 0; a < 3; ++a) eye.push_back(camera.Center()[a]);
  return JsonValue::Object{
      {"rotation", std::move(rotation)},
      {"eye", std::move(eye)},
      {"lens", JsonValue::Array{camera.fx, camera.fy, camera.cx, camera.cy}},
      {"width", camera.width},
      {"height", camera.height},
      {"weights", JsonValue::Array{weight}},
      {"pixels", Pixels(FieldRenderer(field, Backend::kCpu).Render(camera).color)}};
}

enum class Layers { kNone, kResidual, kObject };

// Of every fifth splat, so that most of them stay what the network makes of them.
StyleLayers SomeLayers(Layers kind, size_t splats) {
  StyleLayers layers;
  const auto random = [](uint64_t stream, size_t i, int c) {
    return static_cast<float>(RandomDouble(11, stream, 3 * i + static_cast<uint64_t>(c)));
  };
  for (size_t i = 0; i < splats; ++i) {
    const bool on = i % 5 == 0;
    if (kind == Layers::kObject) {
      layers.weight.push_back(on ? random(3, i, 0) : 0);
      continue;
    }
    Vec3f color{}, scale{1, 1, 1};
    for (int c = 0; c < 3 && on; ++c)
      color[c] = random(1, i, c) - 0.5f, scale[c] = random(2, i, c);
    layers.residual.color.push_back(color);
    layers.residual.view_scale.push_back(scale);
  }
  return layers;
}

void WritePages(const std::string& folder, const std::string& name, const RadianceField& field,
                Layers kind) {
  PageContent content;
  content.cameras = PageCameras();
  content.field = EncodeField(field);
  RadianceField page = DecodeField(content.field);
  const PageRecords places = RecordsInPageOrder(content.field, *page.geometry);
  StyleLayers layers;
  if (kind != Layers::kNone) layers = SomeLayers(kind, places.splat.size());
  content.styles = {EncodeStyle(Style(), page, 0.5, layers, places)};
  content.styles[0].header["id"] = "a";
  content.styles[0].header["name"] = "evening";
  const Image picture(8, 6, 3);
  content.poster = EncodeJpeg(picture, 80);
  content.style_pictures = {content.poster};
  content.colors.mean = {0.4, 0.3, 0.5};
  content.colors.covariance = {{{0.05, 0.02, 0.01}, {0.02, 0.04, 0.01}, {0.01, 0.01, 0.06}}};
  content.photos = {{0, content.poster, "left.jpg"}, {1, content.poster, "right.jpg"}};
  JsonValue::Array views;
  page.appearance = PadShBasis(std::move(page.appearance), 9);
  const RadianceField& styled = content.styles[0].styled;
  for (const double weight : {0.0, 0.5, 1.0})
    for (const Camera& camera : content.cameras)
      views.push_back(ViewJson(camera, weight, MixFields(page, {&styled}, {weight})));
  const PageCheck check{48, 50, 3};
  WriteFileAtomically(folder + "/" + name + ".html", PageHtml(content, &check));
  WriteJsonFile(folder + "/" + name + ".json", JsonValue(std::move(views)));
}

// In the box and around it.
RadianceField SplatsField(int64_t count, int basis, float near_clip, float fit_pixel) {
  const GridFrame box{{}, {0, 0, 0}, {0.8f, 1, 0.7f}};
  const auto splats = testing::RandomSplats(count, basis, 5, 1.3, 0.02);
  RadianceField field =
      FieldOfSplats(testing::CastSplats<float>(splats), box, near_clip, fit_pixel);
  for (int64_t i = 0; i < field.appearance.sh.size(); ++i)
    if (i % basis != 0) field.appearance.sh[i] *= 0.4f;
  return field;
}

void WritePageOfRun(const std::string& folder, const std::string& run,
                    const std::string& name) {
  constexpr int kLongest = 128;
  const MadePage made = MakePage(run, {name}, {}, {});
  const StoredField stored = ReadFieldFile(run + "/field.npz");
  const WorkingViews photos = ReadWorkingViews(run + "/poses", kLongest, 0).InField(stored);
  RadianceField page = DecodeField(EncodeField(stored.field));
  const PageStyle style =
      EncodeStyle(ReadNetworkFile(StyleFolder(run, name) + "/network.npz"), page, 1);
  page.appearance = PadShBasis(std::move(page.appearance), 9);
  JsonValue::Array views;
  for (const double weight : {0.0, 1.0})
    for (const Camera& camera : CheckedViews(photos.Cameras(), kLongest))
      views.push_back(
          ViewJson(camera.Undistorted(), weight, MixFields(page, {&style.styled}, {weight})));
  WriteFileAtomically(folder + "/page.html", made.html);
  WriteJsonFile(folder + "/page.json", JsonValue(std::move(views)));
}

// colors.json: colour maps from the colours of a scene to those of a picture, see EQ(mkl).
void WriteColorMaps(const std::string& folder) {
  const auto statistics = [](uint64_t seed, double spread, int rank) {
    ColorStatistics colors;
    colors.count = 1000;
    colors.mean = {0.3 + 0.1 * RandomDouble(seed, 1, 0), 0.5, 0.4};
    Mat3d root = kZeroMat3d;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < rank; ++j)
        root(i, j) = spread * (RandomDouble(seed, 2, static_cast<uint64_t>(3 * i + j)) - 0.5);
    colors.covariance = root * root.Transposed();
    return colors;
  };
  const auto numbers = [](const Vec3d& v, const Mat3d& m) {
    std::vector<double> all;
    for (int a = 0; a < 3; ++a) all.push_back(v[a]);
    for (const Vec3d& row : m.row)
      for (int a = 0; a < 3; ++a) all.push_back(row[a]);
    return JsonValue(JsonValue::Array(all.begin(), all.end()));
  };
  JsonValue::Array rows;
  for (uint64_t seed = 0; seed < 12; ++seed) {
    // Pictures with colours, a grey scene, a style of one colour, and almost no contrast.
    const ColorStatistics scene = statistics(seed, seed == 10 ? 0.01 : 0.5, seed == 8 ? 1 : 3);
    const ColorStatistics style =
        statistics(seed + 50, seed == 9 ? 0 : 0.6, seed == 11 ? 2 : 3);
    const MklMap mkl = ComputeMkl(scene, style);
    rows.emplace_back(JsonValue::Array{numbers(scene.mean, scene.covariance),
                                       numbers(style.mean, style.covariance),
                                       numbers(mkl.map.offset, mkl.map.matrix)});
  }
  WriteJsonFile(folder + "/colors.json", JsonValue(std::move(rows)));
}

// camera_path.json, and places and weights along it.
void WritePath(const std::string& folder) {
  const JsonValue json = testing::SomeKeyframes();
  WriteJsonFile(folder + "/camera_path.json", json);
  const KeyframePath path = ReadKeyframePath(folder + "/camera_path.json");
  JsonValue::Array table;
  constexpr int kMoments = 45;
  for (int i = -1; i <= kMoments; ++i) {
    const Keyframe key = path.At(path.Seconds() * i / (kMoments - 1));
    std::vector<double> row{key.time};
    for (const Vec3d* v : {&key.eye, &key.forward, &key.up})
      for (int a = 0; a < 3; ++a) row.push_back((*v)[a]);
    for (const double half : key.half) row.push_back(half);
    for (const double weight : key.weights) row.push_back(weight);
    const Camera camera = CameraOfKeyframe(key, kWidth, kHeight, {});
    row.push_back(camera.fx);
    for (const Vec3d& axis : camera.camera_from_world.rotation.row)
      for (int a = 0; a < 3; ++a) row.push_back(axis[a]);
    table.emplace_back(JsonValue::Array(row.begin(), row.end()));
  }
  WriteJsonFile(folder + "/places.json", JsonValue(std::move(table)));
}

}  // namespace
}  // namespace regrade

int main(int argc, char** argv) {
  using namespace regrade;
  if (argc != 2 && argc != 4) {
    std::fprintf(stderr, "usage: write_scene_pages FOLDER [RUN STYLE]\n");
    return 2;
  }
  const std::string folder = argv[1];
  std::filesystem::create_directories(folder);
  if (argc == 4) {
    WritePageOfRun(folder, argv[2], argv[3]);
    return 0;
  }
  WritePages(folder, "splats", SplatsField(600, 9, 0.1f, 1 / 60.0f), Layers::kResidual);
  WritePages(folder, "object", SplatsField(400, 4, 0.2f, -1), Layers::kObject);
  WritePages(folder, "few_harmonics", SplatsField(300, 1, 0.1f, 0), Layers::kNone);
  WritePath(folder);
  WriteColorMaps(folder);
  return 0;
}
