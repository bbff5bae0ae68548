#include "pipeline/images/depth_map.h"

#include <cstdint>
#include <cstring>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/npy_header.h"

namespace regrade {
namespace {

constexpr uint64_t kMostDepthBytes = uint64_t{2} << 30;

template <typename T>
void CopyDepth(const char* from, Image* depth) {
  for (float& value : depth->pixels) {
    T element;
    std::memcpy(&element, from, sizeof element);
    from += sizeof element;
    value = static_cast<float>(element);
  }
}

}  // namespace

Image ReadDepthMap(const std::string& path, int width, int height) {
  const std::string bytes = ReadWholeFile(path, kMostDepthBytes);
  const NpyHeader header = ParseNpyHeader(bytes, path);
  const auto& shape = header.shape;
  const bool flat = shape.size() == 2 || (shape.size() == 3 && shape[2] == 1);
  if (!flat || (header.type != ArrayType::kF32 && header.type != ArrayType::kF64))
    throw InputError("the depth map is no array [height, width] of float32 or float64", path,
                     "write it with numpy.save");
  if (shape[0] != height || shape[1] != width)
    throw InputError(Concat("the depth map is ", shape[1], " x ", shape[0], " px, the frames ",
                            width, " x ", height, " px"),
                     path, "render it at the frames' size");
  if (bytes.size() < header.data_offset + header.data_bytes)
    throw InputError(Concat("the file ends after ", bytes.size(), " of ",
                            header.data_offset + header.data_bytes, " bytes"),
                     path);
  Image depth(width, height, 1);
  if (header.type == ArrayType::kF32)
    CopyDepth<float>(bytes.data() + header.data_offset, &depth);
  else
    CopyDepth<double>(bytes.data() + header.data_offset, &depth);
  return depth;
}

void WriteDepthMap(const std::string& path, const Image& depth) {
  REGRADE_CHECK_EQ(depth.channels, 1);
  std::string bytes = MakeNpyHeader(ArrayType::kF32, {depth.height, depth.width});
  bytes.append(reinterpret_cast<const char*>(depth.pixels.data()),
               depth.pixels.size() * sizeof(float));
  WriteFileAtomically(path, bytes);
}

}  // namespace regrade
