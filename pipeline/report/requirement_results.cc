#include "pipeline/report/requirement_results.h"

#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/report/html_text.h"
#include "pipeline/workspace/metric.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

// "at least 30".
std::string BoundText(const Requirement& wanted) {
  return Format("%s %.6g", wanted.at_least ? "at least" : "at most", wanted.bound);
}

// "measured 29.2, required at least 30", or why there is no number.
std::string Outcome(const CheckedRequirement& requirement) {
  const Metric& measured = requirement.measured;
  const std::string text =
      measured.value ? Format("measured %.6g", *measured.value)
      : requirement.holds
          ? "infinite, no error at all"
          : "no value" + (measured.why.empty() ? std::string() : " (" + measured.why + ")");
  return text + ", required " + BoundText(requirement.wanted);
}

// Characters that XML 1.0 does not have are spelled by EscapeHtml; its names are XML's, too.
std::string Attribute(const char* name, const std::string& value) {
  return std::string(" ") + name + "=\"" + EscapeHtml(value) + "\"";
}

JsonValue ToJson(const CheckedRequirement& requirement) {
  const Requirement& wanted = requirement.wanted;
  JsonValue json = JsonValue::Object{
      {"text", wanted.text},   {"subject", wanted.subject},   {"metric", wanted.metric},
      {"bound", wanted.bound}, {"at_least", wanted.at_least}, {"holds", requirement.holds}};
  if (wanted.gap) json["gap"] = *wanted.gap;
  if (!requirement.of.empty()) json["style"] = requirement.of;
  PutMetric("measured", requirement.measured, &json);
  return json;
}

}  // namespace

std::string JUnitXml(const std::vector<CheckedRequirement>& requirements) {
  const auto failures = std::ranges::count(requirements, false, &CheckedRequirement::holds);
  const std::string counts = Attribute("tests", std::to_string(requirements.size())) +
                             Attribute("failures", std::to_string(failures)) +
                             Attribute("errors", "0");
  std::string xml = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites" +
                    Attribute("name", "regrade") + counts + ">\n  <testsuite" +
                    Attribute("name", "required metrics") + counts + Attribute("skipped", "0") +
                    ">\n";
  for (const CheckedRequirement& requirement : requirements) {
    const std::string& style = requirement.of;
    xml += "    <testcase" +
           Attribute("classname", style.empty() ? "regrade" : "regrade." + style) +
           Attribute("name", requirement.wanted.text) + ">\n";
    xml += requirement.holds
               ? "      <system-out>" + EscapeHtml(Outcome(requirement)) + "</system-out>\n"
               : "      <failure" + Attribute("type", "requirement") +
                     Attribute("message", Outcome(requirement)) + ">" +
                     EscapeHtml(requirement.Sentence()) + "</failure>\n";
    xml += "    </testcase>\n";
  }
  return xml + "  </testsuite>\n</testsuites>\n";
}

void BeginJUnit(const std::string& path) {
  if (path.empty()) return;
  std::error_code error;
  if (fs::is_directory(path, error))
    throw InputError("this is a folder", path, "name a file for --junit");
  const fs::path folder = fs::path(path).parent_path();
  if (!folder.empty() && !fs::is_directory(folder, error))
    throw InputError("there is no such folder", folder.string(), "make it, for --junit");
  fs::remove(path, error);
  if (error)
    throw ResourceError("cannot remove the file of an earlier run: " + error.message(), path);
}

void FinishRequirements(const std::vector<CheckedRequirement>& requirements,
                        const std::string& junit, Console* console) {
  std::string failed;
  for (const CheckedRequirement& requirement : requirements) {
    console->Event("requirement", ToJson(requirement));
    if (requirement.holds)
      console->Info(requirement.Sentence() + ", holds");
    else
      failed += (failed.empty() ? "" : "; ") + requirement.Sentence();
  }
  if (!junit.empty()) WriteFileAtomically(junit, JUnitXml(requirements));
  if (!failed.empty())
    throw Error(ExitCode::kRequirement, "a required metric is out of its bound", failed,
                "report.json has all metrics; the results are complete");
}

}  // namespace regrade
