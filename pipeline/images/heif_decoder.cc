#include "pipeline/images/heif_decoder.h"

#include <libheif/heif.h>

#include <cstring>
#include <memory>

#include "kernels/base/error.h"

namespace regrade {
namespace {

template <auto Function>
struct Free {
  template <typename T>
  void operator()(T* pointer) const {
    Function(pointer);
  }
};
using HeifContext = std::unique_ptr<heif_context, Free<heif_context_free>>;
using Handle = std::unique_ptr<heif_image_handle, Free<heif_image_handle_release>>;
using Decoded = std::unique_ptr<heif_image, Free<heif_image_release>>;
using Nclx = std::unique_ptr<heif_color_profile_nclx, Free<heif_nclx_color_profile_free>>;

// A larger one is not EXIF.
constexpr size_t kLargestExif = 1 << 20;

std::string ExifOf(const heif_image_handle* handle) {
  heif_item_id id = 0;
  if (heif_image_handle_get_list_of_metadata_block_IDs(handle, "Exif", &id, 1) < 1) return "";
  const size_t size = heif_image_handle_get_metadata_size(handle, id);
  if (size <= 4 || size > kLargestExif) return "";
  std::string block(size, '\0');
  if (heif_image_handle_get_metadata(handle, id, block.data()).code != heif_error_Ok) return "";
  // Four bytes say how far the TIFF header is from their end.
  size_t offset = 0;
  for (size_t i = 0; i < 4; ++i) offset = offset << 8 | static_cast<unsigned char>(block[i]);
  return offset < size - 4 ? block.substr(4 + offset) : "";
}

std::string IccOf(const heif_image_handle* handle) {
  const size_t size = heif_image_handle_get_raw_color_profile_size(handle);
  if (size == 0) return "";
  std::string icc(size, '\0');
  if (heif_image_handle_get_raw_color_profile(handle, icc.data()).code != heif_error_Ok)
    return "";
  return icc;
}

template <typename Value>
void CopyPixels(const uint8_t* plane, int stride, float max, Image* image) {
  float* to = image->pixels.data();
  for (int y = 0; y < image->height; ++y)
    for (int i = 0; i < image->width * image->channels; ++i) {
      Value value;
      std::memcpy(&value, plane + static_cast<int64_t>(y) * stride + i * sizeof value,
                  sizeof value);
      *to++ = static_cast<float>(value) / max;
    }
}

}  // namespace

HeifPicture DecodeHeif(std::string_view bytes, const std::string& where,
                       const PictureSizeCheck& check) {
  const auto require = [&](const heif_error& error) {
    if (error.code != heif_error_Ok)
      throw InputError(std::string("cannot read this HEIC or AVIF: ") +
                           (error.message == nullptr ? "no reason given" : error.message),
                       where, "convert it to JPEG (or 16-bit TIFF) first");
  };
  const HeifContext context(heif_context_alloc());
  REGRADE_CHECK(context != nullptr);
  require(heif_context_read_from_memory_without_copy(context.get(), bytes.data(), bytes.size(),
                                                     nullptr));
  heif_image_handle* found = nullptr;
  require(heif_context_get_primary_image_handle(context.get(), &found));
  const Handle handle(found);

  HeifPicture picture;
  picture.pictures = heif_context_get_number_of_top_level_images(context.get());
  const bool alpha = heif_image_handle_has_alpha_channel(found) != 0;
  const int stored_bits = heif_image_handle_get_luma_bits_per_pixel(found);
  const bool wide = stored_bits > 8;
  picture.bits = wide ? 16 : 8;
  const int channels = alpha ? 4 : 3;
  check(heif_image_handle_get_width(found), heif_image_handle_get_height(found),
        static_cast<int64_t>(channels) * picture.bits / 8);
  picture.premultiplied = alpha && heif_image_handle_is_premultiplied_alpha(found) != 0;
  picture.exif = ExifOf(found);
  picture.icc = IccOf(found);
  heif_color_profile_nclx* nclx = nullptr;
  if (heif_image_handle_get_nclx_color_profile(found, &nclx).code == heif_error_Ok) {
    const Nclx owner(nclx);
    picture.primaries = nclx->color_primaries;
    picture.transfer = nclx->transfer_characteristics;
  }

  const heif_chroma chroma =
      wide ? (alpha ? heif_chroma_interleaved_RRGGBBAA_LE : heif_chroma_interleaved_RRGGBB_LE)
           : (alpha ? heif_chroma_interleaved_RGBA : heif_chroma_interleaved_RGB);
  heif_image* decoded = nullptr;
  require(heif_decode_image(found, &decoded, heif_colorspace_RGB, chroma, nullptr));
  const Decoded owner(decoded);
  int stride = 0;
  const uint8_t* plane =
      heif_image_get_plane_readonly(decoded, heif_channel_interleaved, &stride);
  const int width = heif_image_get_width(decoded, heif_channel_interleaved);
  const int height = heif_image_get_height(decoded, heif_channel_interleaved);
  const int bits = heif_image_get_bits_per_pixel_range(decoded, heif_channel_interleaved);
  if (plane == nullptr || width <= 0 || height <= 0 || bits < 1 || bits > 16 ||
      stride < width * channels * picture.bits / 8)
    throw InputError("cannot read this HEIC or AVIF: it has no pixels", where);
  check(width, height, static_cast<int64_t>(channels) * picture.bits / 8);
  picture.image = Image(width, height, channels);
  const float max = static_cast<float>((1 << bits) - 1);
  if (wide)
    CopyPixels<uint16_t>(plane, stride, max, &picture.image);
  else
    CopyPixels<uint8_t>(plane, stride, max, &picture.image);
  return picture;
}

}  // namespace regrade
