// Networks with one input picture: features and embeddings for distances to a style picture,
// and edge maps.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "evaluate/edge_map.h"
#include "evaluate/feature_statistics.h"
#include "evaluate/onnx_runner.h"
#include "kernels/scene/image.h"

namespace regrade {

// Pixels; an embedding network gets the whole picture at this size, by area averaging.
inline constexpr int kEmbeddingSide = 224;

// An ONNX file with one input [1, 3, height, width], RGB from -1 to 1, of any name. Errors:
// those of OnnxRunner, and outputs of another shape.
class ImageNetwork {
 public:
  explicit ImageNetwork(const std::string& path);

  // Of each output [1, channels, ...] the moments over all positions. An output that feeds
  // another operator is not seen.
  std::vector<FeatureStatistics> Features(const Image& picture) const;

  // The only output as one vector, of the picture at kEmbeddingSide squared.
  std::vector<float> Embedding(const Image& picture) const;

  // One channel of the picture's size, as the output [1, 1, height, width] has it.
  Image EdgeMap(const Image& picture) const;

 private:
  OnnxRunner runner_;
};

// Null for an empty path.
std::shared_ptr<const ImageNetwork> OpenImageNetwork(const std::string& path);

// "gradient" or the ONNX file of an edge network, see ImageNetwork::EdgeMap; empty for an empty
// text. Errors: those of ImageNetwork.
EdgeMapFunction EdgeMaps(const std::string& edges);

}  // namespace regrade
