// Values of options from and to text.
#pragma once

#include <charconv>
#include <cmath>
#include <string>
#include <type_traits>

#include "kernels/base/options.h"
#include "pipeline/files/json_file.h"

namespace regrade {

// The shortest text that reads back as the same value, independent of the locale.
template <typename T>
std::string NumberText(T value) {
  char text[64];
  const auto result = std::to_chars(text, text + sizeof text, value);
  return std::string(text, result.ptr);
}

// The double nearest to the float's shortest text: 0.1, not 0.10000000149.
double ShortestDouble(float value);

// "0 to 1", "at least 0".
std::string BoundsText(const OptionInfo& info);

// Throws Error(kUsage): what stands at `where`, and what is allowed there.
[[noreturn]] void RefuseValue(const std::string& where, const std::string& text,
                              const std::string& allowed);

// The whole text must be one finite number within the bounds. Throws as RefuseValue.
template <typename T>
T ParseNumber(const std::string& text, const OptionInfo& info, const std::string& where) {
  T value{};
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  const std::string allowed =
      BoundsText(info) + (std::is_integral_v<T> ? ", a whole number" : "");
  if (result.ec != std::errc() || result.ptr != end || text.empty())
    RefuseValue(where, text, allowed);
  if constexpr (std::is_floating_point_v<T>)
    if (!std::isfinite(value)) RefuseValue(where, text, allowed);
  // Bounds are doubles; whole numbers beyond 2^53 are compared after rounding.
  if (!(static_cast<double>(value) >= info.min && static_cast<double>(value) <= info.max))
    RefuseValue(where, text, allowed);
  return value;
}

// Both throw as RefuseValue.
bool ParseSwitch(const std::string& text, const std::string& where);
std::string ParseChoice(const std::string& text, const OptionInfo& info,
                        const std::string& where);

// The text of a JSON value as a flag's value.
std::string FlagText(const JsonValue& value);

// {"name": value} with the value of a flag of that text.
JsonValue AsConfig(const std::string& name, const std::string& text);

}  // namespace regrade
