#include "pipeline/images/still_file.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"

namespace regrade {

void WriteStill(const std::string& path, const Image& image) {
  REGRADE_CHECK_EQ(image.channels, 3);
  const std::string ending = std::filesystem::path(path).extension().string();
  const bool tiff = ending == ".tif", jpeg = ending == ".jpg";
  REGRADE_CHECK(tiff || jpeg || ending == ".png");
  OIIO::ImageSpec spec(image.width, image.height, 3,
                       tiff ? OIIO::TypeDesc::UINT16 : OIIO::TypeDesc::UINT8);
  // PNG gets a chunk sRGB; JPEG and TIFF the EXIF tag of a colour space, 1 for sRGB.
  spec.attribute("oiio:ColorSpace", "sRGB");
  if (!tiff && !jpeg) spec.attribute("png:compressionLevel", 6);
  if (tiff || jpeg) spec.attribute("Exif:ColorSpace", 1);
  if (jpeg) spec.attribute("Compression", "jpeg:95");
  if (tiff) spec.attribute("Compression", "zip");

  const float most = tiff ? 65535.f : 255.f;
  std::vector<uint16_t> values(image.pixels.size());
  for (size_t i = 0; i < values.size(); ++i) {
    const float v = image.pixels[i];
    // NaN becomes 0.
    values[i] = static_cast<uint16_t>((v > 0 ? std::min(v, 1.0f) : 0.0f) * most + 0.5f);
  }
  std::vector<uint8_t> bytes;
  if (!tiff) bytes.assign(values.begin(), values.end());

  const std::string temporary = path + kTemporarySuffix;
  const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(tiff   ? "tiff"
                                                                              : jpeg ? "jpeg"
                                                                                     : "png");
  const bool written = output != nullptr && output->open(temporary, spec) &&
                       (tiff ? output->write_image(OIIO::TypeDesc::UINT16, values.data())
                             : output->write_image(OIIO::TypeDesc::UINT8, bytes.data())) &&
                       output->close();
  if (!written) {
    const std::string why = output != nullptr ? output->geterror() : OIIO::geterror();
    std::error_code error;
    std::filesystem::remove(temporary, error);
    throw ResourceError("cannot write this picture: " + why, path, "check the disk");
  }
  SyncFile(temporary);
  RenameDurably(temporary, path);
}

}  // namespace regrade
