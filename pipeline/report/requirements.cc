#include "pipeline/report/requirements.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <type_traits>

#include "kernels/base/error.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

constexpr char kForm[] =
    "write SUBJECT:METRIC>=VALUE or <=, as styled:tc-psnr:1>=30; see FORMATS.md";

// Finds the number that a metric's name means among the members of a struct of metrics.
struct NumberFinder {
  const std::string& name;
  std::optional<Metric> found = {};

  template <typename T>
  void operator()(const char* key, T& member, const MetricInfo& = {}) {
    if (found || (key != name && key != name + "_db" && key != name + "_mean_db")) return;
    if constexpr (std::is_same_v<T, Metric>) {
      found = member;
    } else if constexpr (std::is_arithmetic_v<T>) {
      found = Metric(static_cast<double>(member));
    } else if constexpr (std::is_same_v<T, std::optional<double>> ||
                         std::is_same_v<T, std::optional<int>> ||
                         std::is_same_v<T, std::optional<int64_t>>) {
      found = member ? Metric(static_cast<double>(*member)) : Metric();
    }
  }

  void OrNull(const char* key, std::optional<double>& member, const char* = "") {
    Metric metric(member);
    (*this)(key, metric);
  }
};

template <typename Metrics>
std::optional<Metric> NumberIn(Metrics metrics, const std::string& name) {
  NumberFinder finder{name};
  metrics.Describe(finder);
  return finder.found;
}

template <typename T>
bool ReadNumber(const std::string& text, T* value) {
  const char* end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, *value);
  return error == std::errc() && rest == end;
}

// `styled`: how many sequences styled, styled_2, ... there are.
bool IsSequence(const std::string& name, int styled) {
  for (int i = 2; i <= styled; ++i)
    if (name == Concat("styled_", i)) return true;
  const std::string plain = name.starts_with("path_") ? name.substr(5) : name;
  return plain == "source" || plain == "views_2d" || plain == "styled" || plain == "photos";
}

// The stage's number; empty if there is no such stage or metric. `known` tells a stage that has
// not run from one that does not exist.
std::optional<Metric> NumberOfStage(StagesReport stages, const Requirement& wanted,
                                    bool* known) {
  std::optional<Metric> found;
  *known = false;
  stages.ForEach([&](const char* name, auto& stage) {
    if (name != wanted.subject) return;
    *known = true;
    using Report = typename std::remove_reference_t<decltype(stage)>::value_type;
    found = NumberIn(Report(), wanted.metric);
    if (found && stage) found = NumberIn(*stage, wanted.metric);
  });
  return found;
}

// Throws unless an evaluation can measure it.
void CheckName(const Requirement& wanted, const std::vector<int>& gaps, int styled) {
  const bool of_pairs = NumberIn(ConsistencyMetrics(), wanted.metric).has_value();
  const bool of_frames = NumberIn(FidelityRow(), wanted.metric).has_value();
  bool known_metric = of_pairs || of_frames;
  if (!IsSequence(wanted.subject, styled)) {
    bool known = false;
    known_metric = NumberOfStage({}, wanted, &known).has_value();
    if (!known)
      throw UsageError("there is no sequence or stage " + wanted.subject, wanted.text,
                       "sequences are styled, source, views_2d and photos, those of the film "
                       "with path_ in front; stages are those of report.json");
    if (wanted.gap) throw UsageError("metrics of stages have no gap", wanted.text, kForm);
  } else if (known_metric && of_pairs != wanted.gap.has_value()) {
    throw UsageError(of_pairs ? "the gap is missing" : "metrics of frames have no gap",
                     wanted.text, kForm);
  }
  if (!known_metric)
    throw UsageError("there is no metric " + wanted.metric + " of " + wanted.subject,
                     wanted.text, "report.json and FORMATS.md have the names");
  if (wanted.gap && std::ranges::find(gaps, *wanted.gap) == gaps.end())
    throw UsageError(Concat("gap ", *wanted.gap, " is not measured"), wanted.text,
                     "name a gap of --gaps");
}

Requirement ParseRequirement(const std::string& text) {
  Requirement wanted;
  wanted.text = text;
  const size_t relation = std::min(text.find(">="), text.find("<="));
  if (relation == std::string::npos) throw UsageError("there is no bound", text, kForm);
  wanted.at_least = text[relation] == '>';
  if (!ReadNumber(text.substr(relation + 2), &wanted.bound) || !std::isfinite(wanted.bound))
    throw UsageError("the bound is not a number", text, kForm);
  std::vector<std::string> parts = Split(text.substr(0, relation), ':');
  if (parts.size() != 2 && parts.size() != 3)
    throw UsageError("a sequence or stage and a metric are expected", text, kForm);
  for (std::string& part : parts) std::ranges::replace(part, '-', '_');
  wanted.subject = parts[0];
  wanted.metric = parts[1];
  if (parts.size() == 3) {
    wanted.gap = 0;
    if (!ReadNumber(parts[2], &*wanted.gap))
      throw UsageError("the gap is not a whole number", text, kForm);
  }
  return wanted;
}

bool IsStage(const std::string& name) {
  bool known = false;
  StagesReport stages;
  stages.ForEach([&](const char* stage, const auto&) { known = known || stage == name; });
  return known;
}

// A number that the report does not have, but these rows or stages.
Metric OnlyOf(const std::vector<std::string>& there) {
  return Metric::Undefined(there.empty() ? "nothing was measured"
                                         : "measured: " + Join(there, ", "));
}

// The number, or why there is none.
Metric Measured(const Requirement& wanted, const RunReport& report) {
  std::vector<std::string> there;
  if (IsStage(wanted.subject)) {
    bool has_run = false, known = false;
    StagesReport stages = report.stages;
    stages.ForEach([&](const char* name, const auto& stage) {
      if (stage) there.push_back(name);
      has_run = has_run || (stage && name == wanted.subject);
    });
    return has_run ? NumberOfStage(stages, wanted, &known).value_or(Metric()) : OnlyOf(there);
  }
  if (wanted.gap) {
    for (const ConsistencyMetrics& row : report.evaluation.consistency) {
      if (row.sequence == wanted.subject && row.gap == *wanted.gap)
        return NumberIn(row, wanted.metric).value_or(Metric());
      there.push_back(Concat(row.sequence, " at gap ", row.gap));
    }
    return OnlyOf(there);
  }
  for (const FidelityRow& row : report.evaluation.fidelity) {
    if (row.sequence == wanted.subject) return NumberIn(row, wanted.metric).value_or(Metric());
    there.push_back(row.sequence);
  }
  return OnlyOf(there);
}

// "tc_psnr of styled at gap 5 has no value (too few frames)"
std::string NoValue(const Requirement& wanted, const Metric& measured) {
  return wanted.metric + " of " + wanted.subject +
         (wanted.gap ? Concat(" at gap ", *wanted.gap) : "") + " has no value" +
         (measured.why.empty() ? ", and the report does not say why"
                               : " (" + measured.why + ")");
}

}  // namespace

std::vector<Requirement> ParseRequirements(const std::string& text,
                                           const std::vector<int>& gaps, int styled) {
  std::vector<Requirement> requirements;
  if (text.empty()) return requirements;
  for (const std::string& part : Split(text, ',')) {
    requirements.push_back(ParseRequirement(part));
    CheckName(requirements.back(), gaps, styled);
  }
  return requirements;
}

std::string CheckedRequirement::Sentence() const {
  const std::string head = (of.empty() ? "" : of + ": ") + wanted.text + ": ";
  if (measured.value) return head + Format("measured %.6g", *measured.value);
  if (holds) return head + "infinite, no error at all";
  return head + NoValue(wanted, measured);
}

std::vector<CheckedRequirement> CheckRequirements(const std::vector<Requirement>& requirements,
                                                  const RunReport& report,
                                                  const std::string& of) {
  std::vector<CheckedRequirement> checked;
  for (const Requirement& wanted : requirements) {
    CheckedRequirement result{wanted, Measured(wanted, report), false, of};
    const std::optional<double>& value = result.measured.value;
    if (value)
      result.holds = wanted.at_least ? *value >= wanted.bound : *value <= wanted.bound;
    else
      result.holds = result.measured.infinite && wanted.at_least;
    checked.push_back(std::move(result));
  }
  return checked;
}

}  // namespace regrade
