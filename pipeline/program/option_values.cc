#include "pipeline/program/option_values.h"

#include "kernels/base/error.h"
#include "pipeline/files/text.h"

namespace regrade {

double ShortestDouble(float value) {
  double nearest = 0;
  const std::string text = NumberText(value);
  std::from_chars(text.data(), text.data() + text.size(), nearest);
  return nearest;
}

std::string BoundsText(const OptionInfo& info) {
  const bool low = std::isfinite(info.min), high = std::isfinite(info.max);
  if (low && high) return NumberText(info.min) + " to " + NumberText(info.max);
  if (low) return "at least " + NumberText(info.min);
  if (high) return "at most " + NumberText(info.max);
  return "a number";
}

void RefuseValue(const std::string& where, const std::string& text,
                 const std::string& allowed) {
  throw UsageError("'" + text + "' is not allowed", where, "give " + allowed);
}

bool ParseSwitch(const std::string& text, const std::string& where) {
  if (text == "true" || text == "on" || text == "yes") return true;
  if (text == "false" || text == "off" || text == "no") return false;
  RefuseValue(where, text, "true or false");
}

std::string ParseChoice(const std::string& text, const OptionInfo& info,
                        const std::string& where) {
  if (*info.choices == '\0') return text;
  std::string listed;
  for (const std::string& choice : Split(info.choices, '|')) {
    if (choice == text) return text;
    listed += (listed.empty() ? "" : ", ") + choice;
  }
  RefuseValue(where, text, "one of " + listed);
}

std::string FlagText(const JsonValue& value) {
  if (value.IsString()) return value.AsString();
  if (!value.IsArray()) return DumpJson(value, -1);
  std::string text;
  for (const JsonValue& element : value.AsArray()) {
    if (!text.empty()) text += ',';
    text += FlagText(element);
  }
  return text;
}

JsonValue AsConfig(const std::string& name, const std::string& text) {
  try {
    return JsonValue::Object{{name, ParseJson(text, "")}};  // a number, true or false
  } catch (const Error&) {
    return JsonValue::Object{{name, text}};
  }
}

}  // namespace regrade
