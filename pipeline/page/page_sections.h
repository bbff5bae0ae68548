// Parts of a page's field: sections of packed bytes, and numbers of its header.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "kernels/base/vec.h"
#include "pipeline/files/json_file.h"
#include "pipeline/page/color_code.h"
#include "pipeline/page/field_codec.h"

namespace regrade {

// Compresses `bytes` and appends them.
void AddSection(const std::string& name, const std::string& bytes, PageField* page);

// Throws Error(kInput) for a section that is missing, damaged, or larger than `max_bytes`.
std::string SectionBytes(const PageField& page, const std::string& name, uint64_t max_bytes);

JsonValue::Array ArrayOf(const Vec3f& v);

// Throw Error(kInput) for another number of numbers.
std::vector<double> NumbersAt(const JsonValue& object, const char* key, size_t count);
Vec3f Vec3At(const JsonValue& object, const char* key);

// Centre and half extents. Throws Error(kInput) for a box without a volume.
void ReadBox(const JsonValue& header, GridFrame* frame);

// 1, 4 or 9; throws Error(kInput) for anything else.
int BasisOf(const JsonValue& header);

// The code of colours whose rows are predicted from `earlier` ones; see FitColorCode.
ColorCode CodeOfRows(const ColorRows& rows, const std::vector<EarlierRecords>& earlier,
                     double step, const std::vector<float>& weight);

// Numbers [3 basis, n] of a section of colours. Throws Error(kInput) for numbers with more bits
// than their code has.
std::vector<int16_t> ColorNumbers(std::string_view bytes, const ColorCode& code, int basis,
                                  const std::vector<EarlierRecords>& earlier);

// Throws Error(kInput) unless all coefficients are finite.
void CheckColors(const Buffer<float>& sh);

}  // namespace regrade
