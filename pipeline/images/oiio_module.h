// What OpenImageIO reads and writes for us, in a module that is loaded at the first use: it
// brings more than 200 libraries.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "kernels/process/program_module.h"
#include "pipeline/images/image_format.h"
#include "pipeline/images/normalize_photo.h"

namespace regrade {

class OiioModule {
 public:
  virtual ~OiioModule() = default;

  // A file in one of the formats that have no decoder of our own. Throws Error(kInput).
  virtual StoredPicture Read(const ImageFormat& format, std::string_view bytes,
                             const std::string& path, const PictureSizeCheck& check) const = 0;
  // Metadata of an EXIF block, a TIFF without its picture.
  virtual void TakeExif(std::string_view exif, StoredPicture* picture) const = 0;
  // RGB with 16 bits a channel, deflated, tagged as sRGB; `values` are 3 a pixel. Returns why
  // it failed; empty if it did not.
  virtual std::string WriteTiff(const std::string& path, int width, int height,
                                const uint16_t* values) const = 0;
  virtual void LimitThreads(int threads) const = 0;
  // "2.4.7" and whether it develops camera raw.
  virtual std::string Version() const = 0;
  virtual bool ReadsRaw() const = 0;
};

inline const OiioModule& Oiio() {
  using Function = const OiioModule*();
  static const OiioModule& module =
      *reinterpret_cast<Function*>(ModuleFunction("pictures", "RegradeOiioModule"))();
  return module;
}

}  // namespace regrade
