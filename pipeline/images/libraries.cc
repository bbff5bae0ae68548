#include "pipeline/images/libraries.h"

#include <libheif/heif.h>

#include "kernels/base/error.h"
#include "pipeline/images/oiio_module.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/avutil.h>
}

namespace regrade {

namespace {

Library OpenImageIo() {
  constexpr char kName[] = "OpenImageIO";
  try {
    const bool raw = Oiio().ReadsRaw();
    return {kName, Oiio().Version() + (raw ? "" : ", without LibRaw"),
            raw ? "TIFF, WebP, OpenEXR and camera raw" : "TIFF, WebP and OpenEXR"};
  } catch (const Error& error) {
    return {kName, "missing", Concat(error.what_failed(), ". To do: ", error.hint())};
  }
}

}  // namespace

std::vector<Library> PictureLibraries() {
  const bool h264 = avcodec_find_encoder_by_name("libx264") != nullptr;
  return {
      {"FFmpeg", av_version_info() + std::string(h264 ? "" : ", without libx264"),
       h264 ? "films in and out" : "reads films; writing them needs libx264"},
      OpenImageIo(),
      {"libheif", heif_get_version(), "HEIC and AVIF"},
  };
}

}  // namespace regrade
