#include "pipeline/program/convert_pca_kd.h"

#include "kernels/base/error.h"
#include "stylize/image/onnx_writer.h"

namespace regrade {
namespace {

// Layers of one ONNX file; each returns its output's name.
class Layers {
 public:
  Layers(const TensorBundle& bundle, const std::string& where)
      : bundle_(bundle), where_(where) {}

  OnnxWriter& writer() { return writer_; }

  // Reflects `before` pixels at the left and the top and one at the right and the bottom, or
  // repeats the edge.
  std::string Pad(const std::string& x, int64_t before, const char* mode) {
    const std::string pads = Name();
    writer_.Constant(pads, {0, 0, before, before, 0, 0, 1, 1});
    return Add("Pad", {x, pads}, OnnxWriter::Text("mode", mode));
  }
  // What `x` has beyond the mean of 3 x 3 pixels.
  void Detail(const std::string& x, const std::string& out) {
    const std::string mean =
        Add("AveragePool", {Pad(x, 1, "edge")}, OnnxWriter::Integers("kernel_shape", {3, 3}));
    writer_.Node("Sub", {x, mean}, out);
  }
  // `kernel` is [out, in / groups, side, side].
  std::string Convolve(const std::string& x, const BundleTensor& kernel,
                       const std::vector<float>& bias, int64_t groups, int64_t stride,
                       const std::string& out = "") {
    const std::string weights = Name(), biases = Name();
    writer_.Weights(weights, kernel.shape, kernel.values);
    writer_.Weights(biases, {static_cast<int64_t>(bias.size())}, bias);
    return Add("Conv", {x, weights, biases},
               OnnxWriter::Integers("kernel_shape", {kernel.shape[2], kernel.shape[3]}) +
                   OnnxWriter::Integers("strides", {stride, stride}) +
                   OnnxWriter::Integer("group", groups),
               out);
  }
  std::string Add(const std::string& type, const std::vector<std::string>& inputs,
                  const std::string& attributes = "", const std::string& out = "") {
    const std::string name = out.empty() ? Name() : out;
    writer_.Node(type, inputs, name, attributes);
    return name;
  }
  std::string Double(const std::string& x) {
    const std::string region = Name(), scales = Name();
    writer_.Weights(region, {0}, {});
    writer_.Weights(scales, {4}, {1, 1, 2, 2});
    return Add("Resize", {x, region, scales},
               OnnxWriter::Text("mode", "linear") +
                   OnnxWriter::Text("coordinate_transformation_mode", "half_pixel"));
  }

  const std::vector<float>& Bias(const std::string& layer, int64_t channels) const {
    return Find(layer + "/bias", {channels}).values;
  }
  // TensorFlow's [side, side, in, out] as [out, in, side, side].
  BundleTensor Kernel(const std::string& layer, int64_t side, int64_t in, int64_t out) const {
    return Turned(Find(layer + "/kernel", {side, side, in, out}), false);
  }
  // [3, 3, channels, 1] as [channels, 1, 3, 3].
  BundleTensor ChannelKernel(const std::string& layer, int64_t channels) const {
    return Turned(Find(layer + "/depthwise_kernel", {3, 3, channels, 1}), true);
  }

 private:
  std::string Name() { return "t" + std::to_string(names_++); }

  const BundleTensor& Find(const std::string& name, const std::vector<int64_t>& shape) const {
    const auto found = bundle_.find(name + "/.ATTRIBUTES/VARIABLE_VALUE");
    if (found == bundle_.end() || found->second.shape != shape)
      throw InputError("has no tensor " + name + " of the expected shape", where_,
                       "it must be PCA-KD's student with MobileNet's layers");
    return found->second;
  }
  static BundleTensor Turned(const BundleTensor& tensor, bool swap) {
    const int64_t side = tensor.shape[0], a = tensor.shape[2], b = tensor.shape[3],
                  area = side * side;
    BundleTensor turned{{swap ? a : b, swap ? b : a, side, side},
                        std::vector<float>(tensor.values.size())};
    for (int64_t k = 0; k < area; ++k)
      for (int64_t i = 0; i < a; ++i)
        for (int64_t j = 0; j < b; ++j)
          turned.values[static_cast<size_t>((swap ? i * b + j : j * a + i) * area + k)] =
              tensor.values[static_cast<size_t>((k * a + i) * b + j)];
    return turned;
  }

  const TensorBundle& bundle_;
  const std::string& where_;
  OnnxWriter writer_;
  int names_ = 0;
};

constexpr int64_t kChannels[] = {3, 10, 19, 37, 54};

std::string EncoderFile(const TensorBundle& bundle, const std::string& where) {
  Layers layers(bundle, where);
  int next = 0;
  const auto layer = [&next] {
    return "se_model/layer_with_weights-" + std::to_string(next++);
  };
  const auto channels = [&](const std::string& x, int64_t count, bool halve,
                            const std::string& out = "") {
    const std::string name = layer();
    const std::string sum = layers.Convolve(layers.Pad(x, halve ? 0 : 1, "reflect"),
                                            layers.ChannelKernel(name, count),
                                            layers.Bias(name, count), count, halve ? 2 : 1);
    return layers.Add("Relu", {sum}, "", out);
  };
  const auto pixels = [&](const std::string& x, int64_t from, int64_t to) {
    const std::string name = layer();
    return layers.Add("Relu", {layers.Convolve(x, layers.Kernel(name, 1, from, to),
                                               layers.Bias(name, to), 1, 1)});
  };
  layers.writer().Input("image", 3);
  layers.Detail("image", "s1");
  const std::string first = layer();
  BundleTensor kernel = layers.Kernel(first, 3, kChannels[0], kChannels[1]);
  std::vector<float> bias = layers.Bias(first, kChannels[1]);
  const size_t taps = kernel.values.size() / bias.size();
  for (size_t i = 0; i < kernel.values.size(); ++i) {
    bias[i / taps] -= kernel.values[i];  // of 2 x - 1
    kernel.values[i] *= 2;
  }
  const std::string sum =
      layers.Convolve(layers.Pad("image", 0, "reflect"), kernel, bias, 1, 2);
  std::string x = layers.Add("Relu", {sum}, "", "f1");
  for (int block = 2; block <= 4; ++block) {
    const int64_t from = kChannels[block - 1], to = kChannels[block];
    const std::string number = std::to_string(block);
    layers.Detail(x, "s" + number);
    // The second block has one layer for each channel and one for each pixel, the others two.
    if (block == 2) x = channels(x, from, false);
    x = pixels(x, from, to);
    if (block > 2) {
      x = channels(x, to, false);
      x = pixels(x, to, to);
    }
    x = channels(x, to, true, "f" + number);
  }
  for (int block = 1; block <= 4; ++block) {
    layers.writer().Output("f" + std::to_string(block), static_cast<int>(kChannels[block]));
    layers.writer().Output("s" + std::to_string(block), static_cast<int>(kChannels[block - 1]));
  }
  return layers.writer().Bytes();
}

std::string DecoderFile(const TensorBundle& bundle, int level, const std::string& where) {
  Layers layers(bundle, where);
  const int64_t from = kChannels[level], to = kChannels[level - 1];
  const std::string group = "btnecks/" + std::to_string(level - 1) + "/layer_with_weights-";
  layers.writer().Input("feat", static_cast<int>(from));
  layers.writer().Input("skip", static_cast<int>(to));
  const auto convolve = [&](const std::string& x, int index, int64_t in,
                            const std::string& out) {
    const std::string name = group + std::to_string(index);
    return layers.Convolve(layers.Pad(x, 1, "reflect"), layers.Kernel(name, 3, in, to),
                           layers.Bias(name, to), 1, 1, out);
  };
  std::string x = layers.Double("feat");
  if (level == 1) {
    x = layers.Add("Concat", {x, "skip"}, OnnxWriter::Integer("axis", 1));
    convolve(x, 0, from + to, "out");
  } else {
    x = layers.Add("Relu", {convolve(x, 0, from, "")});
    x = layers.Add("Add", {x, "skip"});
    layers.Add("Relu", {convolve(x, 1, to, "")}, "", "out");
  }
  layers.writer().Output("out", static_cast<int>(to));
  return layers.writer().Bytes();
}

}  // namespace

std::vector<std::pair<std::string, std::string>> ConvertPcaKd(const TensorBundle& encoder,
                                                              const TensorBundle& decoder,
                                                              const std::string& where) {
  std::vector<std::pair<std::string, std::string>> files{
      {"encoder.onnx", EncoderFile(encoder, where)}};
  for (int level = 1; level <= 4; ++level)
    files.push_back({Format("decoder%d.onnx", level), DecoderFile(decoder, level, where)});
  return files;
}

}  // namespace regrade
