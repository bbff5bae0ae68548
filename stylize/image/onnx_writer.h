// Writes ONNX files of a few operators byte by byte (Protocol Buffers' wire format; the numbers
// are the fields of onnx.proto3).
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

namespace regrade {

class OnnxWriter {
 public:
  // Empty; Input and Output add pictures of any size.
  OnnxWriter() = default;
  // Two pictures [1, 3, height, width] go in as "first" and "second".
  OnnxWriter(int height, int width) {
    for (const char* name : {"first", "second"})
      graph_ += Field(11, ValueInfo(name, {1, 3, height, width}));
  }

  void Input(const std::string& name, int channels) {
    graph_ += Field(11, ValueInfo(name, {1, channels, kAnySide, kAnySide}));
  }
  void Output(const std::string& name, int channels) {
    outputs_ += Field(12, ValueInfo(name, {1, channels, kAnySide, kAnySide}));
  }

  void Node(const std::string& type, const std::vector<std::string>& inputs,
            const std::string& output, const std::string& attributes = "") {
    std::string node;
    for (const std::string& input : inputs) node += Field(1, input);
    graph_ +=
        Field(1, node + Field(2, output) + Field(3, output) + Field(4, type) + attributes);
    last_ = output;
  }
  static std::string Integer(const std::string& name, int64_t value) {
    return Field(5, Field(1, name) + Number(3, value) + Number(20, 2));
  }
  static std::string Text(const std::string& name, const std::string& value) {
    return Field(5, Field(1, name) + Field(4, value) + Number(20, 3));
  }
  static std::string Integers(const std::string& name, const std::vector<int64_t>& values) {
    std::string attribute = Field(1, name);
    for (const int64_t value : values) attribute += Number(8, value);
    return Field(5, attribute + Number(20, 7));
  }
  void Weights(const std::string& name, const std::vector<int64_t>& shape,
               const std::vector<float>& values) {
    Tensor(name, shape, 1, values);
  }
  void Constant(const std::string& name, const std::vector<int64_t>& values) {
    Tensor(name, {static_cast<int64_t>(values.size())}, 7, values);
  }

  // The last node's output is the network's, of this shape.
  std::string Bytes(const std::vector<int64_t>& shape) const {
    return File(Field(12, ValueInfo(last_, shape)));
  }
  // The network's outputs are those of Output.
  std::string Bytes() const { return File(outputs_); }

 private:
  static constexpr int64_t kAnySide = -1;

  template <typename T>
  void Tensor(const std::string& name, const std::vector<int64_t>& shape, int type,
              const std::vector<T>& values) {
    std::string tensor;
    for (const int64_t side : shape) tensor += Number(1, side);
    std::string raw(values.size() * sizeof(T), '\0');
    if (!values.empty()) std::memcpy(raw.data(), values.data(), raw.size());
    graph_ += Field(5, tensor + Number(2, type) + Field(8, name) + Field(9, raw));
  }

  std::string File(const std::string& outputs) const {
    const std::string graph = graph_ + Field(2, "tiny") + outputs;
    return Number(1, 7) + Field(8, Field(1, "") + Number(2, 11)) + Field(7, graph);
  }
  static std::string Varint(uint64_t value) {
    std::string bytes;
    for (; value >= 128; value >>= 7) bytes += static_cast<char>(value % 128 + 128);
    return bytes + static_cast<char>(value);
  }
  static std::string Number(int field, int64_t value) {
    return Varint(static_cast<uint64_t>(field) << 3) + Varint(static_cast<uint64_t>(value));
  }
  static std::string Field(int field, const std::string& bytes) {
    return Varint(static_cast<uint64_t>(field) << 3 | 2) + Varint(bytes.size()) + bytes;
  }
  static std::string ValueInfo(const std::string& name, const std::vector<int64_t>& shape) {
    std::string sides;
    for (const int64_t side : shape)
      sides +=
          Field(1, side == kAnySide ? Field(2, name + "_side" + std::to_string(sides.size()))
                                    : Number(1, side));
    return Field(1, name) + Field(2, Field(1, Number(1, 1) + Field(2, sides)));
  }

  std::string graph_, outputs_, last_;
};

}  // namespace regrade
