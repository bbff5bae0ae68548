#include "pipeline/stages/block_plan.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/render/field_renderer.h"

namespace regrade {
namespace {

constexpr int kSide = 160;                  // pixels of the longer side of the depth maps
constexpr int64_t kMostPlaces = 4'000'000;  // of all photos
// For a block those photos are read that have so much of the pixels that show it, at least
// three.
constexpr double kShown = 0.98;
constexpr size_t kLeastViews = 3;

struct SeenPlaces {
  std::vector<Vec3f> places;   // of all views, one after another
  std::vector<int64_t> until;  // [views]: how many are of it and of those before
  std::vector<int64_t> step;   // [views]: pixels for each of its places
};

// The places at the middle of every n-th pixel, so that all views give at most kMostPlaces.
SeenPlaces PlacesOf(const WorkingViews& views, const std::vector<int>& of,
                    const FieldRenderer& renderer, const ProgressFunction& progress) {
  SeenPlaces seen;
  const int64_t of_view = kMostPlaces / std::max<int64_t>(1, std::ssize(of));
  for (const int i : of) {
    ReportOrThrow(progress, std::ssize(seen.until), std::ssize(of), "where the photos look");
    const Camera camera = views.AtSize(kSide).CameraOf(i);
    const RigidTransform world_from_camera = camera.camera_from_world.Inverse();
    const Image depth = renderer.Render(camera).depth;
    const int64_t pixels = depth.num_pixels(),
                  step = std::max<int64_t>(1, (pixels + of_view - 1) / of_view);
    for (int64_t pixel = 0; pixel < pixels; pixel += step) {
      const float z = depth.pixels[static_cast<size_t>(pixel)];
      if (!(z > 0)) continue;
      const Vec3d ray = camera.CameraRay(static_cast<double>(pixel % depth.width) + 0.5,
                                         static_cast<double>(pixel / depth.width) + 0.5);
      seen.places.push_back((world_from_camera * (ray * double{z})).Cast<float>());
    }
    seen.until.push_back(std::ssize(seen.places));
    seen.step.push_back(step);
  }
  return seen;
}

JsonValue BoundsToJson(const Vec3f& bounds) {
  return JsonValue::Array{double{bounds.x}, double{bounds.y}, double{bounds.z}};
}

// Without an end: null.
Vec3f BoundsFromJson(const JsonValue& json, float without_end) {
  const JsonValue::Array& values = json.AsArray();
  if (values.size() != 3) throw InputError("three numbers are expected", json.Place());
  Vec3f bounds;
  for (int a = 0; a < 3; ++a) {
    const JsonValue& value = values[static_cast<size_t>(a)];
    bounds[a] = value.IsNull() ? without_end : static_cast<float>(value.AsDouble());
  }
  return bounds;
}

JsonValue HoldToJson(const SplatHold& hold) {
  return JsonValue::Object{{"low", BoundsToJson(hold.low)}, {"high", BoundsToJson(hold.high)}};
}

SplatHold HoldFromJson(const JsonValue& json) {
  return {BoundsFromJson(json.At("low"), -SplatHold::kUnbounded),
          BoundsFromJson(json.At("high"), SplatHold::kUnbounded)};
}

}  // namespace

BlockPlan PlanBlocks(const WorkingViews& views, const StoredField& coarse, int blocks,
                     Backend backend, const ProgressFunction& progress) {
  const std::vector<int> training = views.Training();
  const SeenPlaces seen =
      PlacesOf(views, training, FieldRenderer(coarse.field, backend), progress);
  BlockPlan plan;
  plan.blocks = DivideSpace(seen.places, coarse.field.geometry->frame, blocks);
  for (const SpaceBlock& block : plan.blocks) {
    std::vector<std::pair<int64_t, int>> shown;  // minus the pixels, and the view
    int64_t at = 0, all = 0;
    for (size_t v = 0; v < training.size(); ++v) {
      int64_t pixels = 0;
      for (; at < seen.until[v]; ++at)
        pixels += block.held.Contains(&seen.places[static_cast<size_t>(at)].x);
      shown.emplace_back(-pixels * seen.step[v], training[v]);
      all += pixels * seen.step[v];
    }
    std::ranges::sort(shown);
    std::vector<int>& of_block = plan.views.emplace_back();
    int64_t covered = 0;
    for (const auto& [pixels, view] : shown) {
      if (of_block.size() >= kLeastViews &&
          static_cast<double>(covered) >= kShown * static_cast<double>(all))
        break;
      of_block.push_back(view);
      covered -= pixels;
    }
    std::ranges::sort(of_block);
  }
  return plan;
}

JsonValue PlanToJson(const BlockPlan& plan) {
  const auto numbers = [](const std::vector<int>& values) {
    JsonValue array = JsonValue::Array();
    for (const int value : values) array.Append(value);
    return array;
  };
  JsonValue json = JsonValue::Array();
  for (size_t i = 0; i < plan.blocks.size(); ++i) {
    const SpaceBlock& block = plan.blocks[i];
    json.Append(JsonValue::Object{{"owned", HoldToJson(block.owned)},
                                  {"held", HoldToJson(block.held)},
                                  {"after", numbers(block.after)},
                                  {"turn", block.turn},
                                  {"share", block.share},
                                  {"repeats", block.repeats},
                                  {"views", numbers(plan.views[i])}});
  }
  return json;
}

BlockPlan PlanFromJson(const JsonValue& json) {
  const auto numbers = [](const JsonValue& array) {
    std::vector<int> values;
    for (const JsonValue& value : array.AsArray())
      values.push_back(static_cast<int>(value.AsInt()));
    return values;
  };
  BlockPlan plan;
  for (const JsonValue& value : json.AsArray()) {
    plan.blocks.push_back(
        {HoldFromJson(value.At("owned")), HoldFromJson(value.At("held")),
         numbers(value.At("after")), static_cast<int>(value.At("turn").AsInt()),
         value.At("share").AsDouble(), static_cast<int>(value.At("repeats").AsInt())});
    plan.views.push_back(numbers(value.At("views")));
  }
  return plan;
}

}  // namespace regrade
