// A measured number, and a decision that was made by one: what records keep and the report
// shows.
#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <utility>

namespace regrade {

// A number, or the reason why there is none. JSON has no NaN: a value that is not finite is a
// figure without value.
struct Figure {
  std::optional<double> value;
  std::string why = "not measured";  // read only while `value` is empty

  Figure() = default;
  Figure(double number) {  // NOLINT: a number is a figure
    if (std::isfinite(number)) {
      value = number;
    } else {
      why = std::isnan(number) ? "not a number" : "infinite: no error at all";
    }
  }
  static Figure Undefined(std::string why) {
    Figure figure;
    figure.why = std::move(why);
    return figure;
  }
};

// One decision of the scene profile.
struct EffectReport {
  std::string name;
  bool on = false;
  std::string evidence;  // a sentence for a person
  Figure value;          // what was measured, in the unit that `evidence` names
  Figure threshold;
};

}  // namespace regrade
