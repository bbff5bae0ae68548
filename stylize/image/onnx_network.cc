#include "stylize/image/onnx_network.h"

#include <omp.h>

namespace regrade {

std::vector<FeatureMap> OnnxNetwork::Run(const std::vector<Input>& inputs,
                                         const std::vector<std::string>& outputs) const {
  std::string wanted;
  for (const std::string& name : outputs) wanted += (wanted.empty() ? "" : ", ") + name;
  std::vector<OnnxModel::Input> arrays;
  for (const auto& [name, map] : inputs)
    arrays.push_back({name, {1, map->channels, map->height, map->width}, map->values.data()});
  OnnxModel::UseThreads(omp_get_max_threads());  // what --threads says
  std::vector<OnnxArray> results = model_.Run(
      arrays, outputs, "it must have the outputs " + wanted + " and take pictures of any size");
  std::vector<FeatureMap> maps;
  for (size_t i = 0; i < results.size(); ++i) {
    const std::vector<int>& shape = results[i].shape;
    if (shape.size() != 4 || shape[0] != 1)
      model_.Refuse("its output \"" + outputs[i] + "\" is not one map",
                    "expected is [1, channels, height, width]");
    FeatureMap& map = maps.emplace_back();
    map.channels = shape[1];
    map.height = shape[2];
    map.width = shape[3];
    map.values = std::move(results[i].values);
  }
  return maps;
}

}  // namespace regrade
