#include "pipeline/stages/carried_edit.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "pipeline/capture/photo_names.h"
#include "pipeline/images/image_file.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {
namespace {

// A photo sees a point whose depth is that of all four pixels around, up to this fraction: at
// a silhouette the layer is of either side.
constexpr double kDepthTolerance = 0.03;

bool SameView(const Camera& a, const Camera& b) {
  const auto same = [](const Vec3d& x, const Vec3d& y) { return Dot(x - y, x - y) == 0; };
  return a.SameIntrinsics(b) && same(a.Center(), b.Center()) &&
         same(a.Forward(), b.Forward()) && same(a.Up(), b.Up());
}

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

// What the layer of a photo adds to a point of the scene; false where the photo does not see
// it.
bool LayerAt(const Camera& camera, const Image& layer, const Image& depth, const Vec3d& point,
             Vec3d* added) {
  double u, v, z;
  if (!camera.Project(point, &u, &v, &z) || !(z > 0)) return false;
  if (!(u >= 0 && v >= 0 && u < camera.width && v < camera.height)) return false;
  bool seen = true;
  *added = {};
  Bilinear(u, v, layer).ForEach([&](int x, int y, double weight) {
    seen &= std::abs(double{*depth.at(x, y)} - z) <= kDepthTolerance * z;
    const float* c = layer.at(x, y);
    *added += Vec3d{c[0], c[1], c[2]} * weight;
  });
  return seen;
}

}  // namespace

std::vector<Image> LayersOf(const ResidualChoice& choice, const WorkingViews& views) {
  std::vector<Image> layers(static_cast<size_t>(views.count()));
  if (choice.Layers().empty()) return layers;
  std::vector<std::string> photos;
  for (const CaptureView& view : views.capture().views) photos.push_back(view.file);
  const std::vector<std::string> paths = PicturesByPhotoName(choice.Layers(), photos, "layer");
  for (size_t i = 0; i < layers.size(); ++i) {
    if (paths[i].empty()) continue;
    const Camera camera = views.CameraOf(static_cast<int>(i));
    layers[i] = Colors(ReadGivenImage(paths[i]));
    for (float& v : layers[i].pixels) v = 2 * v - 1;
    if (layers[i].width != camera.width || layers[i].height != camera.height)
      layers[i] = Resize(layers[i], camera.width, camera.height);
  }
  return layers;
}

CarriedEdit::CarriedEdit(const ResidualChoice& choice, const WorkingViews& views,
                         const FieldRenderer& source) {
  std::vector<Image> layers = LayersOf(choice, views);
  for (size_t i = 0; i < layers.size(); ++i) {
    if (layers[i].empty()) continue;
    const Camera camera = views.CameraOf(static_cast<int>(i));
    photos_.push_back({camera, std::move(layers[i]), source.Render(camera).depth});
  }
}

Image CarriedEdit::AddTo(const Camera& camera, const Image& depth, Image* picture) const {
  REGRADE_CHECK(picture->SameSize(depth));
  Image seen(depth.width, depth.height, 1);
  const RigidTransform world_from_camera = camera.camera_from_world.Inverse();
  std::vector<const Photo*> of_this;  // photos of the very view: all of their pixels count
  for (const Photo& photo : photos_)
    if (SameView(camera, photo.camera)) of_this.push_back(&photo);
#pragma omp parallel for schedule(static)
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      Vec3d sum{}, added;
      int count = 0;
      for (const Photo* photo : of_this) {
        const float* c = photo->layer.at(x, y);
        sum += Vec3d{c[0], c[1], c[2]}, ++count;
      }
      const double z = *depth.at(x, y);
      const Vec3d ray = camera.CameraRay(x + 0.5, y + 0.5);
      if (of_this.empty() && z > 0 && std::isfinite(z) && ray.z > 0) {
        const Vec3d point = world_from_camera * (ray * (z / ray.z));
        for (const Photo& photo : photos_)
          if (LayerAt(photo.camera, photo.layer, photo.depth, point, &added))
            sum += added, ++count;
      }
      if (count == 0) continue;
      *seen.at(x, y) = 1;
      for (int c = 0; c < 3; ++c) {
        float* value = picture->at(x, y) + c;
        *value = std::clamp(*value + static_cast<float>(sum[c] / count), 0.0f, 1.0f);
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
