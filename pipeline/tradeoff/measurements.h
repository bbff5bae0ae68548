// What has been measured, kept on disk measurement by measurement, so that an interruption
// costs no more than the one in hand.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/files/json_file.h"
#include "pipeline/tradeoff/parameters.h"

namespace regrade {

struct Measurement {
  std::string benchmark, parameter, value;
  int repeat = 0;
  double seconds = 0, cpu_seconds = 0;  // of what the plane says
  double accuracy = 0;                  // in the plane's unit
  // What the work was, for predictions: {"rays": ..., "voxels": ...}.
  JsonValue work = JsonValue::Object();
};

class MeasurementStore {
 public:
  // Reads what is there. Measurements of another fingerprint (other photos, other base options,
  // another program) are as good as none, and are dropped with the next one that is added.
  MeasurementStore(const std::string& path, const std::string& fingerprint);

  const Measurement* Find(const Variant& variant, int repeat) const;
  // Durable when it returns.
  void Add(const Measurement& measurement);
  const std::vector<Measurement>& all() const { return all_; }

 private:
  std::string path_, fingerprint_;
  std::vector<Measurement> all_;
};

JsonValue ToJson(const Measurement& measurement);

}  // namespace regrade
