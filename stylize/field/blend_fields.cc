#include "stylize/field/blend_fields.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/field/pad_sh_basis.h"

namespace regrade {
namespace {

// A sum of weights may miss 1 by its rounding.
constexpr double kSumSlack = 1e-9;

double CheckWeights(const std::vector<double>& weights) {
  double sum = 0;
  for (const double weight : weights) {
    if (!(weight >= 0 && weight <= 1))
      throw UsageError(std::to_string(weight) + " is not a fraction", "--mix",
                       "fractions lie between 0 (the unstyled scene) and 1 (the whole style)");
    sum += weight;
  }
  if (sum > 1 + kSumSlack)
    throw UsageError("fractions add up to " + std::to_string(sum), "--mix",
                     "they may add up to 1; the rest is the unstyled scene");
  return sum;
}

void MixVoxel(const std::vector<const float*>& parts, const double* weights, int stride,
              float* out) {
  // One part alone keeps its bits.
  int alone = -1, count = 0;
  for (size_t i = 0; i < parts.size(); ++i)
    if (weights[i] != 0) alone = static_cast<int>(i), ++count;
  if (count == 1) {
    std::copy_n(parts[alone], stride, out);
    return;
  }
  for (int k = 0; k < stride; ++k) {
    double value = 0;
    for (size_t i = 0; i < parts.size(); ++i)
      if (weights[i] != 0) value += weights[i] * static_cast<double>(parts[i][k]);
    out[k] = static_cast<float>(value);
  }
}

}  // namespace

bool SameGeometry(const Geometry& a, const Geometry& b) {
  if (&a == &b) return true;
  const auto same = [](const auto& x, const auto& y) {
    return x.size() == y.size() &&
           (x.size() == 0 ||
            std::memcmp(x.data(), y.data(), static_cast<size_t>(x.size()) * sizeof(x[0])) == 0);
  };
  const auto same_vector = [](const auto& x, const auto& y) {
    return x.x == y.x && x.y == y.y && x.z == y.z;
  };
  return same_vector(a.frame.resolution, b.frame.resolution) &&
         same_vector(a.frame.center, b.frame.center) &&
         same_vector(a.frame.radius, b.frame.radius) && same(a.links, b.links) &&
         same(a.density, b.density) && same(a.splats.mean, b.splats.mean) &&
         same(a.splats.log_scale, b.splats.log_scale) &&
         same(a.splats.quaternion, b.splats.quaternion) &&
         same(a.splats.opacity_logit, b.splats.opacity_logit) &&
         a.splats.fit_pixel == b.splats.fit_pixel && a.spheres.layers == b.spheres.layers &&
         same(a.spheres.links, b.spheres.links) && same(a.spheres.density, b.spheres.density);
}

RadianceField MixFields(const RadianceField& source,
                        const std::vector<const RadianceField*>& styles,
                        const std::vector<double>& weights,
                        const std::vector<float>* object_weights) {
  REGRADE_CHECK_EQ(styles.size(), weights.size());
  const double sum = CheckWeights(weights);
  if (!styles.empty() && styles[0]->appearance.basis > source.appearance.basis) {
    RadianceField padded = source;
    padded.appearance = PadShBasis(std::move(padded.appearance), styles[0]->appearance.basis);
    return MixFields(padded, styles, weights, object_weights);
  }
  for (size_t i = 0; i < styles.size(); ++i)
    if (styles[i]->appearance.basis != source.appearance.basis ||
        !SameGeometry(*source.geometry, *styles[i]->geometry))
      throw InputError(
          Concat("style ", i + 1, " is of another reconstruction"), "",
          "styles that are mixed restyle one field: make them with `regrade stylize`");
  const int64_t voxels = source.geometry->num_voxels();
  const int stride = source.appearance.stride();
  if (object_weights != nullptr) REGRADE_CHECK_EQ(std::ssize(*object_weights), voxels);

  std::vector<double> part_weights{std::abs(1 - sum) <= kSumSlack ? 0 : 1 - sum};
  part_weights.insert(part_weights.end(), weights.begin(), weights.end());
  RadianceField mixed;
  mixed.geometry = source.geometry;
  mixed.near_clip = source.near_clip;
  mixed.march = source.march;
  mixed.background = source.background;
  if (object_weights == nullptr) {
    std::vector<const float*> backgrounds{&source.background.x};
    for (const RadianceField* style : styles) backgrounds.push_back(&style->background.x);
    MixVoxel(backgrounds, part_weights.data(), 3, &mixed.background.x);
  }
  mixed.appearance.basis = source.appearance.basis;
  mixed.appearance.sh.Resize(source.appearance.sh.size());
#pragma omp parallel
  {
    std::vector<const float*> parts(styles.size() + 1);
    std::vector<double> here = part_weights;
#pragma omp for schedule(static)
    for (int64_t v = 0; v < voxels; ++v) {
      parts[0] = source.appearance.sh.data() + v * stride;
      for (size_t i = 0; i < styles.size(); ++i)
        parts[i + 1] = styles[i]->appearance.sh.data() + v * stride;
      if (object_weights != nullptr) {
        const double object_weight = (*object_weights)[v];
        double left = 1;
        for (size_t i = 1; i < here.size(); ++i) {
          here[i] = object_weight * part_weights[i];
          left -= here[i];
        }
        here[0] = object_weight == 1 ? part_weights[0] : object_weight == 0 ? 1 : left;
      }
      MixVoxel(parts, here.data(), stride, mixed.appearance.sh.data() + v * stride);
    }
  }
  // Background spheres have no voxels and belong to no object.
  mixed.appearance.sphere_color = source.appearance.sphere_color;
  if (object_weights == nullptr) {
    std::vector<const float*> parts(styles.size() + 1);
    for (int64_t t = 0; t < mixed.appearance.sphere_color.size(); t += 3) {
      parts[0] = source.appearance.sphere_color.data() + t;
      for (size_t i = 0; i < styles.size(); ++i)
        parts[i + 1] = styles[i]->appearance.sphere_color.data() + t;
      MixVoxel(parts, part_weights.data(), 3, mixed.appearance.sphere_color.data() + t);
    }
  }
  return mixed;
}

}  // namespace regrade
