#include "pipeline/page/field_codec.h"

#include "kernels/base/error.h"
#include "pipeline/page/coarse_field.h"
#include "pipeline/page/splat_codec.h"
#include "pipeline/page/voxel_codec.h"

namespace regrade {
namespace {

std::optional<RadianceField> CoarseVoxels(const RadianceField& field) {
  return CoarseField(field);
}

std::optional<RadianceField> NoCoarseField(const RadianceField&) { return std::nullopt; }

struct KindCodec {
  const char* records;
  PageField (*encode)(const RadianceField& field, double step);
  RadianceField (*decode)(const PageField& page);
  std::optional<RadianceField> (*coarse)(const RadianceField& field);
  PageRecords (*in_page_order)(const PageField& page, const Geometry& geometry);
  std::vector<float> (*color_weights)(const Geometry& geometry);
};

constexpr KindCodec kVoxelCodec{"voxels",     EncodeVoxels,      DecodeVoxels,
                                CoarseVoxels, VoxelsInPageOrder, OpacityOfVoxels};
constexpr KindCodec kSplatCodec{"splats",      EncodeSplats,      DecodeSplats,
                                NoCoarseField, SplatsInPageOrder, LightOfSplats};

const KindCodec& CodecOf(const Geometry& geometry) {
  return geometry.splats.on() ? kSplatCodec : kVoxelCodec;
}

const KindCodec& CodecOf(const PageField& page) {
  const JsonValue* const splats = page.header.Find("splats");
  return splats != nullptr && !splats->IsNull() ? kSplatCodec : kVoxelCodec;
}

}  // namespace

PageField EncodeField(const RadianceField& field, double step) {
  return CodecOf(*field.geometry).encode(field, step);
}

RadianceField DecodeField(const PageField& page) {
  if (page.header.At("format").AsInt() != kPageFormat)
    throw InputError("is of another format", "page");
  RadianceField field = CodecOf(page).decode(page);
  Validate(field, "page");
  return field;
}

std::optional<PageField> EncodeCoarse(const RadianceField& field, double step) {
  const std::optional<RadianceField> coarse = CodecOf(*field.geometry).coarse(field);
  if (!coarse) return std::nullopt;
  return EncodeField(*coarse, step);
}

PageRecords RecordsInPageOrder(const PageField& page, const Geometry& geometry) {
  return CodecOf(page).in_page_order(page, geometry);
}

const char* RecordsName(const PageField& page) { return CodecOf(page).records; }

std::vector<float> ColorWeights(const Geometry& geometry) {
  return CodecOf(geometry).color_weights(geometry);
}

}  // namespace regrade
