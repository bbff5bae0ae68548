#include "pipeline/images/oiio_module.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <OpenImageIO/tiffutils.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// Seconds times sensitivity over the square of the f-number, which is 1 where it is not given.
double LightOf(const OIIO::ImageSpec& spec) {
  const auto number = [&spec](std::initializer_list<const char*> names) {
    for (const char* name : names)
      if (const float value = spec.get_float_attribute(name); value > 0) return value;
    return 1.0f;
  };
  const float seconds = spec.get_float_attribute("ExposureTime");
  const float sensitivity =
      number({"Exif:PhotographicSensitivity", "Exif:ISOSpeedRatings", "Exif:ISOSpeed"});
  const float stop = number({"FNumber"});
  return seconds > 0 ? double{seconds} * sensitivity / (double{stop} * stop) : 0;
}

// Degrees, minutes and seconds under `name` as degrees, with the sign of their hemisphere;
// nothing where a part is missing or out of range.
std::optional<double> DegreesOf(const OIIO::ImageSpec& spec, const std::string& name,
                                char negative, double limit) {
  float parts[3] = {};
  if (!spec.getattribute(name, OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 3), parts)) return {};
  const double degrees = parts[0] + parts[1] / 60.0 + parts[2] / 3600.0;
  if (!(degrees >= 0 && degrees <= limit)) return {};
  const std::string_view half = spec.get_string_attribute(name + "Ref");
  return half.starts_with(negative) ? -degrees : degrees;
}

std::optional<GeoPosition> PositionOf(const OIIO::ImageSpec& spec) {
  const std::optional<double> latitude = DegreesOf(spec, "GPS:Latitude", 'S', 90),
                              longitude = DegreesOf(spec, "GPS:Longitude", 'W', 180);
  if (!latitude || !longitude) return {};
  // Receivers without a fix write zeros.
  if (*latitude == 0 && *longitude == 0) return {};
  const float altitude = spec.get_float_attribute("GPS:Altitude");
  const bool below = spec.get_int_attribute("GPS:AltitudeRef") == 1;
  return GeoPosition{*latitude, *longitude,
                     !std::isfinite(altitude) ? 0
                     : below                  ? -altitude
                                              : altitude};
}

// Metadata under OpenImageIO's names.
void TakeMetadata(const OIIO::ImageSpec& spec, StoredPicture* picture) {
  const int orientation = spec.get_int_attribute("Orientation", 1);
  picture->orientation = orientation >= 1 && orientation <= 8 ? orientation : 1;
  picture->taken = spec.get_string_attribute("Exif:DateTimeOriginal");
  const std::string fraction = spec.get_string_attribute("Exif:SubsecTimeOriginal");
  if (!picture->taken.empty() && !fraction.empty()) picture->taken += "." + fraction;
  picture->light = LightOf(spec);
  picture->gps = PositionOf(spec);
  picture->focal_mm = spec.get_float_attribute("Exif:FocalLength");
  picture->focal_35mm = spec.get_float_attribute("Exif:FocalLengthIn35mmFilm");
  picture->exif_width = spec.get_float_attribute("Exif:PixelXDimension");
  // EXIF units: 2 inch (also the default), 3 cm, 4 mm, 5 um.
  const int unit = spec.get_int_attribute("Exif:FocalPlaneResolutionUnit", 2);
  const double unit_mm = unit == 3 ? 10 : unit == 4 ? 1 : unit == 5 ? 0.001 : 25.4;
  picture->focal_plane_px_per_mm =
      spec.get_float_attribute("Exif:FocalPlaneXResolution") / unit_mm;
}

// Reads grey, RGB, or RGB + alpha of the file's channels, as exact quotients value / max: every
// decoder gives the same float for the same integer.
template <typename Value>
bool ReadChannels(OIIO::ImageInput* input, const OIIO::ImageSpec& spec, float max,
                  Image* image) {
  const int stored = spec.nchannels;
  const bool has_alpha = spec.alpha_channel >= 0 && spec.alpha_channel < stored && stored > 1;
  const bool grey = stored - (has_alpha ? 1 : 0) < 3;
  std::vector<Value> values(static_cast<size_t>(spec.width) * spec.height * stored);
  if (!input->read_image(0, 0, 0, stored, OIIO::BaseTypeFromC<Value>::value, values.data()))
    return false;
  *image = Image(spec.width, spec.height, has_alpha ? 4 : grey ? 1 : 3);
  for (int64_t i = 0; i < image->num_pixels(); ++i) {
    const Value* from = &values[static_cast<size_t>(i) * stored];
    float* to = &image->pixels[i * image->channels];
    for (int c = 0; c < std::min(image->channels, 3); ++c)
      to[c] = static_cast<float>(from[grey ? 0 : c]) / max;
    if (has_alpha) to[3] = static_cast<float>(from[spec.alpha_channel]) / max;
  }
  return true;
}

class Module : public OiioModule {
 public:
  StoredPicture Read(const ImageFormat& format, std::string_view bytes, const std::string& path,
                     const PictureSizeCheck& check) const override {
    const auto refuse = [&](const std::string& why) {
      throw InputError(std::string("cannot read this ") + format.name + ": " + why, path,
                       format.remedy);
    };
    std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::create(format.decoder);
    if (input == nullptr) {
      OIIO::geterror();
      refuse("this build has no decoder for it");
    }
    OIIO::ImageSpec spec, config;
    config["oiio:UnassociatedAlpha"] = 1;
    // Camera raw: the same development for every photo.
    config["raw:ColorSpace"] = "sRGB";
    config["raw:use_camera_wb"] = 1;
    config["raw:auto_bright"] = 0;
    config["raw:adjust_maximum_thr"] = 0.f;
    OIIO::Filesystem::IOMemReader memory(bytes.data(), bytes.size());
    if (format.from_memory) input->set_ioproxy(&memory);
    if (!input->open(path, spec, config)) refuse(input->geterror());
    check(spec.width, spec.height, static_cast<int64_t>(spec.pixel_bytes(true)));
    if (spec.deep || spec.depth > 1) refuse("it is not a flat picture");

    StoredPicture picture;
    bool whole = false;
    if (spec.format == OIIO::TypeDesc::UINT8) {
      whole = ReadChannels<uint8_t>(input.get(), spec, 255.f, &picture.image);
    } else if (spec.format == OIIO::TypeDesc::UINT16) {
      picture.bits = 16;
      whole = ReadChannels<uint16_t>(input.get(), spec, 65535.f, &picture.image);
    } else {
      picture.bits = 32;
      whole = ReadChannels<float>(input.get(), spec, 1.f, &picture.image);
    }
    if (!whole) refuse(input->geterror());
    TakeMetadata(spec, &picture);
    const OIIO::string_view space = spec.get_string_attribute("oiio:ColorSpace");
    picture.linear_light = OIIO::Strutil::iequals(space, "linear");
    picture.premultiplied = spec.get_int_attribute("oiio:UnassociatedAlpha") == 0;
    if (const OIIO::ParamValue* profile = spec.find_attribute("ICCProfile"))
      picture.icc.assign(static_cast<const char*>(profile->data()),
                         static_cast<size_t>(profile->datasize()));
    std::array<float, 8> chromaticities;
    if (spec.getattribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8),
                          chromaticities.data()))
      picture.chromaticities = chromaticities;
    if (input->seek_subimage(1, 0))
      picture.notices.push_back("only the first picture of several is used");
    return picture;
  }

  void TakeExif(std::string_view exif, StoredPicture* picture) const override {
    OIIO::ImageSpec spec;
    OIIO::decode_exif(OIIO::string_view(exif.data(), exif.size()), spec);
    TakeMetadata(spec, picture);
  }

  std::string WriteTiff(const std::string& path, int width, int height,
                        const uint16_t* values) const override {
    OIIO::ImageSpec spec(width, height, 3, OIIO::TypeDesc::UINT16);
    spec.attribute("oiio:ColorSpace", "sRGB");
    spec.attribute("Exif:ColorSpace", 1);  // sRGB
    spec.attribute("Compression", "zip");
    const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create("tiff");
    if (output == nullptr) return OIIO::geterror();
    const bool written = output->open(path, spec) &&
                         output->write_image(OIIO::TypeDesc::UINT16, values) && output->close();
    return written ? "" : output->geterror();
  }

  void LimitThreads(int threads) const override { OIIO::attribute("threads", threads); }

  std::string Version() const override { return OIIO_VERSION_STRING; }

  bool ReadsRaw() const override {
    const std::string readers = OIIO::get_string_attribute("format_list");
    return readers.find("raw") != std::string::npos;
  }
};

}  // namespace
}  // namespace regrade

extern "C" __attribute__((visibility("default"))) const regrade::OiioModule*
RegradeOiioModule() {
  static const regrade::Module module;
  return &module;
}
