#include "evaluate/image_network.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"

namespace regrade {
namespace {

// Which would weigh colours.
Image WithoutAlpha(const Image& picture) {
  if (picture.channels != 4) return picture;
  Image colour(picture.width, picture.height, 3);
  for (int64_t p = 0; p < picture.num_pixels(); ++p)
    std::copy_n(&picture.pixels[static_cast<size_t>(4 * p)], 3,
                &colour.pixels[static_cast<size_t>(3 * p)]);
  return colour;
}

}  // namespace

ImageNetwork::ImageNetwork(const std::string& path)
    : runner_(
          path,
          "it must have one input, [1, 3, height, width] from -1 to 1, and take pictures of "
          "any size") {}

std::vector<FeatureStatistics> ImageNetwork::Features(const Image& picture) const {
  std::vector<FeatureStatistics> statistics;
  for (const OnnxArray& output : runner_.RunAll({{"", &picture}})) {
    if (output.shape.size() < 3 || output.shape[0] != 1 || output.values.empty())
      runner_.Refuse("an output has no channels with positions",
                     "expected: [1, channels, height, width], or positions in one row");
    statistics.emplace_back(output.values, output.shape[1]);
  }
  return statistics;
}

std::vector<float> ImageNetwork::Embedding(const Image& picture) const {
  const Image square = Resize(WithoutAlpha(picture), kEmbeddingSide, kEmbeddingSide);
  return runner_.Run({{"", &square}}).values;
}

Image ImageNetwork::EdgeMap(const Image& picture) const {
  OnnxArray output = runner_.Run({{"", &picture}});
  if (output.shape != std::vector<int>{1, 1, picture.height, picture.width})
    runner_.Refuse(Concat("its output is not an edge map of ", picture.width, " x ",
                          picture.height, " pixels"),
                   "expected: [1, 1, height, width] from 0 to 1");
  Image map(picture.width, picture.height, 1);
  map.pixels = std::move(output.values);
  return map;
}

std::shared_ptr<const ImageNetwork> OpenImageNetwork(const std::string& path) {
  return path.empty() ? nullptr : std::make_shared<const ImageNetwork>(path);
}

EdgeMapFunction EdgeMaps(const std::string& edges) {
  if (edges.empty()) return {};
  if (edges == kGradientEdges) return GradientEdges;
  return [network = OpenImageNetwork(edges)](const Image& picture) {
    return network->EdgeMap(picture);
  };
}

}  // namespace regrade
