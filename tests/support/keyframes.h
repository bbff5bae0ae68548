// A camera path as a page writes it.
#pragma once

#include "pipeline/files/json_file.h"

namespace regrade::testing {

// Four keyframes and two styles, "a" and "b"; keyframe 1 looks along y.
inline JsonValue SomeKeyframes() {
  using Array = JsonValue::Array;
  const auto key = [](double time, const Array& eye, const Array& forward, double half_width,
                      const Array& weights) {
    return JsonValue::Object{{"time", time},
                             {"eye", eye},
                             {"forward", forward},
                             {"up", Array{0.1, 0, 1}},
                             {"half_width", half_width},
                             {"half_height", 0.3},
                             {"weights", weights}};
  };
  return JsonValue::Object{
      {"format", "regrade camera path"},
      {"version", 1},
      {"frames_per_second", 24},
      {"styles", Array{"a", "b"}},
      {"keyframes", Array{key(0, {1.5, 0.2, 0.1}, {-1, 0, 0.1}, 0.4, {0, 0}),
                          key(1.5, {0.3, -1.25, 0.4}, {0, 1, 0}, 0.5, {1, 0}),
                          key(2, {-1.5, 0, 0.5}, {1, 0.3, -0.2}, 0.6, {0.25, 0.75}),
                          key(5.5, {0, 1.5, 0.7}, {0.2, -1, -0.4}, 0.45, {0, 0.5})}}};
}

}  // namespace regrade::testing
