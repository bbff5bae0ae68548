// Stores measurements on disk one by one, so that an interruption loses only the current one.
#pragma once

#include <string>
#include <vector>

#include "pipeline/files/json_file.h"
#include "pipeline/study/parameters.h"

namespace regrade {

struct Measurement {
  std::string benchmark, parameter, value;
  int repeat = 0;
  double seconds = 0, cpu_seconds = 0;  // see Benchmark::time_of
  double accuracy = 0;                  // in the benchmark's unit
  // Beside a PSNR to photos: see PhotoMetrics.
  std::optional<double> ssim = {}, detail_kept = {}, lpips = {};
  // Amount of work, for information: {"rays": ..., "voxels": ...}.
  JsonValue work = JsonValue::Object();
};

class MeasurementStore {
 public:
  // Reads the file at `path`, if any. Ignores measurements with another fingerprint (other
  // photos, other base options, another program); the next Add drops them. Throws Error(kInput)
  // for a damaged file or another schema.
  MeasurementStore(const std::string& path, const std::string& fingerprint);

  const Measurement* Find(const Variant& variant, int repeat) const;
  // Durable on return.
  void Add(const Measurement& measurement);
  const std::vector<Measurement>& all() const { return all_; }

 private:
  std::string path_, fingerprint_;
  std::vector<Measurement> all_;
};

JsonValue ToJson(const Measurement& measurement);

}  // namespace regrade
