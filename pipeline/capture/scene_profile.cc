#include "pipeline/capture/scene_profile.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include "kernels/base/error.h"
#include "pipeline/capture/track_colors.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/images/image_file.h"
#include "pipeline/workspace/metrics_json.h"
#include "reconstruct/scene/forward_facing.h"
#include "reconstruct/scene/given_poses.h"
#include "reconstruct/scene/scene_checks.h"
#include "reconstruct/scene/visual_hull.h"

namespace regrade {
namespace {

constexpr int kSilhouetteSide = 512;
constexpr double kAlphaFraction = 0.02;  // of the pixels; less is a photo with a soft edge

EffectReport Row(const char* name, bool on, double value, double threshold,
                 const std::string& evidence) {
  return {name, on, evidence, value, threshold};
}

std::string Short(const Metric& metric) {
  if (!metric.value) return metric.why;
  return Format("%.3g", *metric.value);
}

std::string AlphaPath(const CaptureView& view) {
  const size_t dot = view.path.rfind(".png");
  return dot == std::string::npos ? "" : view.path.substr(0, dot) + ".alpha.png";
}

// A silhouette of at most kSilhouetteSide pixels a side, each the most opaque of those it
// replaces, so that hundreds of large photos need not be in memory at once.
Silhouette Reduced(const Silhouette& full) {
  const int side = std::max(full.alpha.width, full.alpha.height);
  const int factor = (side + kSilhouetteSide - 1) / kSilhouetteSide;
  if (factor <= 1) return full;
  const int width = full.alpha.width / factor, height = full.alpha.height / factor;
  Silhouette small{full.camera.Resized(width, height), Image(width, height, 1)};
  for (int y = 0; y < height * factor; ++y)
    for (int x = 0; x < width * factor; ++x) {
      float& most = *small.alpha.at(x / factor, y / factor);
      most = std::max(most, *full.alpha.at(x, y));
    }
  return small;
}

// Silhouettes of all photos; empty unless each has one.
std::vector<Silhouette> ReadSilhouettes(const Capture& capture) {
  std::vector<Silhouette> silhouettes;
  for (const CaptureView& view : capture.views)
    if (!std::filesystem::is_regular_file(AlphaPath(view))) return {};
  for (const CaptureView& view : capture.views)
    silhouettes.push_back(Reduced({view.camera, ReadImage(AlphaPath(view))}));
  return silhouettes;
}

double TransparentFraction(const std::vector<Silhouette>& silhouettes) {
  int64_t clear = 0, all = 0;
  for (const Silhouette& silhouette : silhouettes) {
    all += silhouette.alpha.num_pixels();
    clear += std::ranges::count_if(silhouette.alpha.pixels, [](float a) { return a < 0.5f; });
  }
  return all > 0 ? static_cast<double>(clear) / static_cast<double>(all) : 0;
}

// Names the photos whose exposure is left unchanged: too few observations.
void NameUnknownPhotos(const Capture& capture, SceneProfile* profile) {
  std::string names;
  for (size_t v = 0; v < capture.views.size(); ++v)
    if (!profile->exposure.photos[v].known)
      names += (names.empty() ? "" : ", ") + capture.views[v].file;
  if (!names.empty())
    profile->notices.push_back(Concat("exposure: left unchanged, for fewer than ",
                                      kFewestColors,
                                      " colours in common with other photos: ", names));
}

std::string GainsEvidence(const ExposureEstimate& exposure) {
  return "fraction of the photos' colour differences at held-out points that the gains "
         "explain" +
         Format("; spread of the gains %.3g, standard error %.2g; ", exposure.spread,
                exposure.median_error) +
         "a spread up to " + Short(Metric{kExposureSpread}) + " is not corrected";
}

// The row "falloff", of a lens whose falloff is asked for: undoing it does not pay on every
// capture whose corners are dark (COSTS.md), so nothing else switches it on.
LensFalloff ProfileFalloff(int views, const std::vector<ColorObservation>& colors,
                           SceneProfile* profile) {
  const FalloffEstimate estimate = EstimateFalloff(views, colors);
  profile->effects.push_back(
      Row("falloff", true, 1 - estimate.corner, estimate.Threshold(),
          Format("share of the light that the lens's corners lose, standard error %.2g; it "
                 "explains %.3g of what photos' colours differ by, standard error %.2g",
                 estimate.corner_error, estimate.explained, estimate.explained_error)));
  return estimate.falloff;
}

// The row "exposure", that of a falloff that is asked for, and the gains of what is on.
void ProfileLight(const Capture& capture, const std::map<std::string, bool>& overrides,
                  bool alpha, SceneProfile* profile) {
  const auto wish = [&overrides](const char* name) {
    const auto override = overrides.find(name);
    return override == overrides.end() ? std::optional<bool>() : override->second;
  };
  const std::optional<bool> of_exposure = wish("exposure");
  const bool falloff_on = wish("falloff").value_or(false);
  const char* const why = alpha ? "the white background of transparent photos has no exposure"
                          : capture.points.empty()
                              ? "the poses are without points to compare colours at"
                              : nullptr;
  if (why != nullptr && (falloff_on || of_exposure.value_or(false)))
    throw SceneError(why, falloff_on ? "--effects falloff=on" : "--effects exposure=on");
  const bool no_exposure = why != nullptr || !of_exposure.value_or(true);
  if (no_exposure)
    profile->effects.push_back({"exposure", false,
                                of_exposure.value_or(true) ? why : "off by --effects", Metric(),
                                kExposureSpread});
  if (no_exposure && !falloff_on) return;
  const int views = static_cast<int>(capture.views.size());
  TrackColors colors = ReadTrackColors(capture);
  LensFalloff falloff;
  if (falloff_on) {
    falloff = ProfileFalloff(views, colors.observations, profile);
    colors.observations = WithoutFalloff(std::move(colors.observations), falloff);
  }
  if (!no_exposure) {
    profile->exposure = EstimateExposure(views, colors.observations);
    const ExposureEstimate& exposure = profile->exposure;
    const bool on = of_exposure.value_or(exposure.Pays());
    profile->effects.push_back(
        Row("exposure", on, exposure.explained, exposure.Threshold(), GainsEvidence(exposure)));
    if (on) profile->gains = GainsOf(exposure, colors.clipped);
    if (on) NameUnknownPhotos(capture, profile);
  }
  if (falloff == LensFalloff{}) return;
  if (profile->gains.of_view.empty()) profile->gains.of_view.resize(capture.views.size());
  for (PhotoGain& gain : profile->gains.of_view) gain.falloff = falloff;
}

}  // namespace

bool ShowsThroughPhotos(const Capture& capture) {
  return TransparentFraction(ReadSilhouettes(capture)) > kAlphaFraction;
}

SceneProfile ProfileScene(const Capture& capture, int sh_degree, const std::string& effects,
                          const BoxOptions& box, const FieldKind& field) {
  const std::map<std::string, bool> overrides = ParseEffects(effects);
  const auto decided = [&overrides](const char* name, bool measured) {
    const auto override = overrides.find(name);
    return override == overrides.end() ? measured : override->second;
  };
  SceneProfile profile;
  double shift = 0;
  for (const CaptureView& view : capture.views)
    shift = std::max(shift, view.camera.MaxCornerDistortion());
  profile.effects.push_back(
      Row("distortion", shift > kDistortionThreshold, shift, kDistortionThreshold,
          "largest shift of a picture's corner by the lens, over the cameras, in pixels"));

  const std::vector<Silhouette> silhouettes = ReadSilhouettes(capture);
  const double clear = TransparentFraction(silhouettes);
  const bool alpha = decided("alpha", clear > kAlphaFraction);

  const Capture sure = WithParallax(capture, kLeastParallaxDeg);
  const ForwardFacing forward = MeasureForwardFacing(sure);
  const bool ndc = field.lattice && decided("ndc", forward.on && !alpha);
  profile.effects.push_back(Row("ndc", ndc, forward.angle_deg, kForwardAngle,
                                "forward-facing cameras: largest angle of an optical axis "
                                "to their mean, degrees"));
  profile.effects.push_back(Row("alpha", alpha, clear, kAlphaFraction,
                                "fraction of transparent pixels, if every photo has some"));
  const Surroundings surroundings =
      MeasureSurroundings(WithParallax(capture, kNoParallaxDeg), box.camera_range);
  const bool background =
      decided("background", surroundings.far_fraction > kFarFraction && !ndc && !alpha);
  if (background && (ndc || alpha))
    throw UsageError(
        std::string("a far background cannot be combined with ") + (ndc ? "ndc" : "alpha"),
        "--effects background=on", ndc ? "add ndc=off" : "add alpha=off");
  profile.effects.push_back(
      Row("background", background, surroundings.far_fraction, kFarFraction,
          std::string(field.far_records) +
              " around the box, for scenes with much far background: fraction of "
              "observations of points beyond four times the cameras' extent"));
  profile.effects.push_back(Row(kViewDependence, sh_degree > 0, sh_degree, 0,
                                "degree of the fit's spherical harmonics, as set"));

  const bool cube = !ndc && box.camera_range > 0;
  const bool surrounded = cube || (background && field.lattice);
  profile.scene = ndc          ? NormalizeForwardFacing(sure, forward, box.margin)
                  : surrounded ? NormalizeSurrounded(sure, surroundings)
                               : NormalizeScene(sure);
  profile.scene.box.far_surroundings = background;
  if (alpha && !silhouettes.empty()) {
    if (!ndc && !cube) profile.scene = TightenToSilhouettes(profile.scene, silhouettes);
    profile.scene.box.background =
        Vec3f{1, 1, 1};  // transparent photos are composited on white
  }
  if (box.near_clip >= 0) profile.scene.box.near_clip = box.near_clip;
  if (box.background >= 0)
    profile.scene.box.background = Vec3f{box.background, box.background, box.background};
  ProfileLight(capture, overrides, alpha, &profile);
  return profile;
}

std::string EffectLine(const EffectReport& effect) {
  if (!effect.value.value)
    return effect.name + (effect.on ? " on: " : " off: ") + effect.value.why + " (" +
           effect.evidence + ")";
  return effect.name + (effect.on ? " on: " : " off: ") + Short(effect.value) +
         (effect.threshold.value && *effect.value.value > *effect.threshold.value ? " > "
                                                                                  : " <= ") +
         Short(effect.threshold) + " (" + effect.evidence + ")";
}

JsonValue EffectsRecord(const std::vector<EffectReport>& effects) {
  return MetricsToJson(effects);
}

std::vector<EffectReport> EffectsOfRecord(const JsonValue& record) {
  return MetricsFromJson<std::vector<EffectReport>>(record);
}

}  // namespace regrade
