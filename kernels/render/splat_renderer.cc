#include "kernels/render/splat_renderer.h"

#include <mutex>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/splats/cpu/render_splats.h"
#include "kernels/splats/cuda/device_splat_renderer.h"
#include "kernels/splats/rendered_splats.h"
#include "kernels/splats/splat_field.h"

namespace regrade {
namespace {

// Splats are sorted by a frame's depth and blended as they are: there is no faster picture to
// trade for.
class SplatRenderer : public Renderer {
 public:
  explicit SplatRenderer(const RadianceField& field) : options_(SplatOptionsOf(field)) {}

 protected:
  // Splats are in the world, whose rays need no device coordinates.
  static Camera PinholeOf(Camera camera) {
    REGRADE_CHECK(camera.lens == LensModel::kPinhole);
    camera.ndc = {};
    return camera;
  }

  SplatOptions options_;
};

class CpuSplatRenderer : public SplatRenderer {
 public:
  explicit CpuSplatRenderer(RadianceField field)
      : SplatRenderer(field), field_(std::move(field)) {}

  RenderedView Render(const Camera& camera) const override {
    SplatFrame frame = FrameOf(camera);
    RenderedView view = RenderedSplats(RenderSplats(frame));
    Keep(std::move(frame));
    return view;
  }

  RenderedPair RenderWith(const Renderer& other, const Camera& camera) const override {
    const auto& same = dynamic_cast<const CpuSplatRenderer&>(other);
    SplatFrame frame = FrameOf(camera);
    RenderedPair pair{RenderedSplats(RenderSplats(frame)), {}};
    Recolor(SplatsOf(same.field_), &frame);
    pair.other_color = RenderedSplats(RenderSplats(frame)).color;
    Keep(std::move(frame));
    return pair;
  }

 private:
  SplatFrame FrameOf(const Camera& camera) const {
    SplatFrame frame;
    {
      const std::lock_guard lock(mutex_);
      frame = std::exchange(kept_, {});
    }
    MakeSplatFrame(SplatsOf(field_), PinholeOf(camera), options_, &frame);
    return frame;
  }
  void Keep(SplatFrame frame) const {
    const std::lock_guard lock(mutex_);
    kept_ = std::move(frame);
  }

  RadianceField field_;
  mutable std::mutex mutex_;
  mutable SplatFrame kept_;  // the last one, for its memory: fresh pages take long
};

class CudaSplatRenderer : public SplatRenderer {
 public:
  explicit CudaSplatRenderer(const RadianceField& field) : SplatRenderer(field) {
    device_.Upload(SplatsOf(field));
  }

  RenderedView Render(const Camera& camera) const override {
    renderer_.Render(device_.view(), PinholeOf(camera), options_);
    return RenderedSplats(renderer_.Download());
  }

  RenderedPair RenderWith(const Renderer& other, const Camera& camera) const override {
    return {Render(camera), dynamic_cast<const CudaSplatRenderer&>(other).Render(camera).color};
  }

 private:
  DeviceSplats device_;
  mutable DeviceSplatRenderer renderer_;  // its memory is kept between frames
};

}  // namespace

std::unique_ptr<Renderer> MakeSplatRenderer(const RadianceField& field, Backend backend) {
  if (backend == Backend::kCuda) return std::make_unique<CudaSplatRenderer>(field);
  return std::make_unique<CpuSplatRenderer>(field);
}

std::unique_ptr<Renderer> TakeSplats(RadianceField&& field, Backend backend) {
  if (backend == Backend::kCuda) return MakeSplatRenderer(field, backend);
  return std::make_unique<CpuSplatRenderer>(std::move(field));
}

}  // namespace regrade
