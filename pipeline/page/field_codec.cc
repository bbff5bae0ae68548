#include "pipeline/page/field_codec.h"

#include "kernels/base/error.h"
#include "pipeline/page/coarse_field.h"
#include "pipeline/page/splat_codec.h"
#include "pipeline/page/voxel_codec.h"

namespace regrade {
namespace {

bool HasSplats(const PageField& page) {
  const JsonValue* const splats = page.header.Find("splats");
  return splats != nullptr && !splats->IsNull();
}

}  // namespace

PageField EncodeField(const RadianceField& field, double step) {
  return field.geometry->splats.on() ? EncodeSplats(field, step) : EncodeVoxels(field, step);
}

RadianceField DecodeField(const PageField& page) {
  if (page.header.At("format").AsInt() != kPageFormat)
    throw InputError("is of another format", "page");
  RadianceField field = HasSplats(page) ? DecodeSplats(page) : DecodeVoxels(page);
  Validate(field, "page");
  return field;
}

std::optional<PageField> EncodeCoarse(const RadianceField& field, double step) {
  if (field.geometry->splats.on()) return std::nullopt;
  const std::optional<RadianceField> coarse = CoarseField(field);
  if (!coarse) return std::nullopt;
  return EncodeField(*coarse, step);
}

PageVoxels RecordsInPageOrder(const PageField& page, const Geometry& geometry) {
  return geometry.splats.on() ? SplatsInPageOrder(page, geometry)
                              : VoxelsInPageOrder(page, geometry);
}

const char* RecordsName(const PageField& page) { return HasSplats(page) ? "splats" : "voxels"; }

std::vector<float> ColorWeights(const Geometry& geometry) {
  return geometry.splats.on() ? LightOfSplats(geometry) : OpacityOfVoxels(geometry);
}

}  // namespace regrade
