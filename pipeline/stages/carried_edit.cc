#include "pipeline/stages/carried_edit.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "pipeline/capture/photo_names.h"
#include "pipeline/images/image_file.h"
#include "pipeline/workspace/output_names.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {
namespace {

// A photo sees a point whose depth is that of all four pixels around, up to this fraction: at
// a silhouette the layer is of either side.
constexpr double kDepthTolerance = 0.03;

bool SameViewpoint(const Camera& a, const Camera& b) {
  const auto same = [](const Vec3d& x, const Vec3d& y) { return Dot(x - y, x - y) == 0; };
  return a.SameIntrinsics(b) && same(a.Center(), b.Center()) &&
         same(a.Forward(), b.Forward()) && same(a.Up(), b.Up());
}

Vec3d VectorAt(const float* c) { return {c[0], c[1], c[2]}; }

// The four pixels around an image point, and the weight of the right and the lower ones.
struct Bilinear {
  int x = 0, y = 0;
  double right = 0, down = 0;

  Bilinear(double u, double v, const Image& image) {
    const double column = std::clamp(u - 0.5, 0.0, std::max(0.0, image.width - 1.001)),
                 row = std::clamp(v - 0.5, 0.0, std::max(0.0, image.height - 1.001));
    x = static_cast<int>(column), y = static_cast<int>(row);
    right = column - x, down = row - y;
  }
  template <typename Visit>  // visit(x, y, weight)
  void ForEach(Visit&& visit) const {
    for (int j = 0; j < 2; ++j)
      for (int i = 0; i < 2; ++i)
        visit(x + i, y + j, (i == 0 ? 1 - right : right) * (j == 0 ? 1 - down : down));
  }
};

// What the edit of a photo keeps of the colour of a point of the scene, and adds to it; false
// where the photo does not see it.
bool EditAt(const Camera& camera, const RenderedEdit& edit, const Image& depth,
            const Vec3d& point, Vec3d* kept, Vec3d* added) {
  double u, v, z;
  if (!camera.Project(point, &u, &v, &z) || !(z > 0)) return false;
  if (!(u >= 0 && v >= 0 && u < camera.width && v < camera.height)) return false;
  bool seen = true;
  *kept = *added = {};
  Bilinear(u, v, depth).ForEach([&](int x, int y, double weight) {
    seen &= std::abs(double{*depth.at(x, y)} - z) <= kDepthTolerance * z;
    *kept += VectorAt(edit.kept(x, y)) * weight;
    *added += VectorAt(edit.added(x, y)) * weight;
  });
  return seen;
}

// The pictures of `folder` by the photos' names, at the size of their cameras; empty where a
// photo has none.
std::vector<Image> PicturesOf(const std::string& folder, const std::string& kind,
                              const WorkingViews& views) {
  std::vector<Image> pictures(static_cast<size_t>(views.count()));
  if (folder.empty()) return pictures;
  const std::vector<std::string> paths =
      PicturesByPhotoName(folder, FilesOf(views.capture()), kind);
  for (size_t i = 0; i < pictures.size(); ++i) {
    if (paths[i].empty()) continue;
    const Camera camera = views.CameraOf(static_cast<int>(i));
    pictures[i] = Colors(ReadGivenImage(paths[i]));
    if (pictures[i].width != camera.width || pictures[i].height != camera.height)
      pictures[i] = Resize(pictures[i], camera.width, camera.height);
  }
  return pictures;
}

}  // namespace

std::vector<Image> LayersOf(const ResidualChoice& choice, const WorkingViews& views) {
  std::vector<Image> layers = PicturesOf(choice.Layers(), "layer", views);
  for (Image& layer : layers)
    for (float& v : layer.pixels) v = 2 * v - 1;
  return layers;
}

// Of a window of pixels around each, the gain a of the line without an offset that fits what
// the layer takes by the colour before: sum(p l) / (sum(p^2) + e). A black pixel knows nothing
// of it and takes it from its neighbours.
RenderedEdit::RenderedEdit(const Image& before, const Image& layer)
    : kept_(layer.width, layer.height, 3), added_(layer) {
  std::ranges::fill(kept_.pixels, 1.0f);
  if (before.empty()) return;
  REGRADE_CHECK(before.SameSize(layer) && before.channels == 3 && layer.channels == 3);
  constexpr double kLevel = 1.0 / 255;  // its square is each pixel's part of e
  const int radius = std::max(1, std::max(layer.width, layer.height) / 256);
#pragma omp parallel for schedule(static)
  for (int y = 0; y < layer.height; ++y)
    for (int x = 0; x < layer.width; ++x)
      for (int c = 0; c < 3; ++c) {
        double product = 0, square = 0;
        for (int v = std::max(0, y - radius); v <= std::min(layer.height - 1, y + radius); ++v)
          for (int u = std::max(0, x - radius); u <= std::min(layer.width - 1, x + radius);
               ++u) {
            const double p = std::clamp(double{before.at(u, v)[c]}, 0.0, 1.0);
            product += p * std::min(0.0, double{layer.at(u, v)[c]});
            square += p * p + kLevel * kLevel;
          }
        kept_.at(x, y)[c] = static_cast<float>(std::clamp(1 + product / square, 0.0, 1.0));
      }
  for (float& v : added_.pixels) v = std::max(0.0f, v);
}

Image RenderedEdit::On(Image picture) const {
  REGRADE_CHECK(picture.SameSize(kept_));
  for (size_t i = 0; i < picture.pixels.size(); ++i)
    picture.pixels[i] =
        std::clamp(picture.pixels[i] * kept_.pixels[i] + added_.pixels[i], 0.0f, 1.0f);
  return picture;
}

std::vector<RenderedEdit> EditsOf(const ResidualChoice& choice, const WorkingViews& views) {
  const std::vector<Image> layers = LayersOf(choice, views);
  std::vector<RenderedEdit> edits(layers.size());
  if (choice.Layers().empty()) return edits;
  const std::string folder =
      (std::filesystem::path(choice.Layers()).parent_path() / kRetouchedFolder).string();
  const std::vector<Image> retouched =
      PicturesOf(std::filesystem::exists(folder) ? folder : "", "retouched picture", views);
  for (size_t i = 0; i < edits.size(); ++i) {
    if (layers[i].empty()) continue;
    Image before = retouched[i];
    for (size_t k = 0; k < before.pixels.size(); ++k) before.pixels[k] -= layers[i].pixels[k];
    edits[i] = RenderedEdit(before, layers[i]);
  }
  return edits;
}

CarriedEdit::CarriedEdit(const ResidualChoice& choice, const WorkingViews& views,
                         const FieldRenderer& source) {
  std::vector<RenderedEdit> edits = EditsOf(choice, views);
  for (size_t i = 0; i < edits.size(); ++i) {
    if (edits[i].empty()) continue;
    const Camera camera = views.CameraOf(static_cast<int>(i));
    photos_.push_back({camera, std::move(edits[i]), source.Render(camera).depth});
  }
}

Image CarriedEdit::AddTo(const Camera& camera, const Image& depth, Image* picture) const {
  REGRADE_CHECK(picture->SameSize(depth));
  Image seen(depth.width, depth.height, 1);
  const RigidTransform world_from_camera = camera.camera_from_world.Inverse();
  std::vector<const Photo*> of_this;  // photos of the very view: all of their pixels count
  for (const Photo& photo : photos_)
    if (SameViewpoint(camera, photo.camera)) of_this.push_back(&photo);
#pragma omp parallel for schedule(static)
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      Vec3d sum_kept{}, sum_added{}, kept, added;
      int count = 0;
      for (const Photo* photo : of_this) {
        sum_kept += VectorAt(photo->edit.kept(x, y));
        sum_added += VectorAt(photo->edit.added(x, y)), ++count;
      }
      const double z = *depth.at(x, y);
      const Vec3d ray = camera.CameraRay(x + 0.5, y + 0.5);
      if (of_this.empty() && z > 0 && std::isfinite(z) && ray.z > 0) {
        const Vec3d point = world_from_camera * (ray * (z / ray.z));
        for (const Photo& photo : photos_)
          if (EditAt(photo.camera, photo.edit, photo.depth, point, &kept, &added))
            sum_kept += kept, sum_added += added, ++count;
      }
      if (count == 0) continue;
      *seen.at(x, y) = 1;
      for (int c = 0; c < 3; ++c) {
        float* value = picture->at(x, y) + c;
        *value = std::clamp(
            static_cast<float>((double{*value} * sum_kept[c] + sum_added[c]) / count), 0.0f,
            1.0f);
      }
    }
  return seen;
}

FrameSource WhereEdited(const FrameSource& frames, const FrameSource& edited) {
  return {frames.count, [frames, edited](int i) {
            Image frame = frames.frame(i);
            const Image where = edited.frame(i);
            REGRADE_CHECK(frame.SameSize(where));
            for (int64_t p = 0; p < where.num_pixels(); ++p)
              if (where.pixels[static_cast<size_t>(p * where.channels)] < 0.5f)
                std::fill_n(&frame.pixels[static_cast<size_t>(p * frame.channels)],
                            frame.channels, std::nanf(""));
            return frame;
          }};
}

double MeanOfPictures(const FrameSource& pictures) {
  double sum = 0, count = 0;
  for (int i = 0; i < pictures.count; ++i)
    for (const float v : pictures.frame(i).pixels) sum += double{v}, ++count;
  return sum / std::max(1.0, count);
}

Image WithLayer(Image picture, const Image& layer, double strength) {
  REGRADE_CHECK(picture.SameSize(layer));
  for (size_t i = 0; i < picture.pixels.size(); ++i)
    picture.pixels[i] = std::clamp(
        picture.pixels[i] + static_cast<float>(strength) * layer.pixels[i], 0.0f, 1.0f);
  return picture;
}

}  // namespace regrade
