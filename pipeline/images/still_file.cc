#include "pipeline/images/still_file.h"

#include <cstdint>
#include <filesystem>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/images/oiio_module.h"
#include "pipeline/images/picture_encoder.h"

namespace regrade {
namespace {

void WriteTiff(const std::string& path, const Image& image) {
  const std::vector<uint16_t> values = Quantized<uint16_t>(image);
  const std::string temporary = path + kTemporarySuffix;
  const std::string why = Oiio().WriteTiff(temporary, image.width, image.height, values.data());
  if (!why.empty()) {
    std::error_code error;
    std::filesystem::remove(temporary, error);
    throw ResourceError("cannot write this picture: " + why, path, "check the disk");
  }
  SyncFile(temporary);
  RenameDurably(temporary, path);
}

}  // namespace

void WriteStill(const std::string& path, const Image& image) {
  REGRADE_CHECK_EQ(image.channels, 3);
  const std::string ending = std::filesystem::path(path).extension().string();
  REGRADE_CHECK(ending == ".tif" || ending == ".jpg" || ending == ".png");
  if (ending == ".tif") return WriteTiff(path, image);
  WriteFileAtomically(
      path, ending == ".jpg" ? EncodeJpeg(image, 95, true) : EncodePng(image, 8, 6, true));
}

}  // namespace regrade
