#include "pipeline/program/option_binding.h"

#include <algorithm>
#include <boost/program_options.hpp>
#include <cmath>
#include <cstring>

#include "kernels/base/error.h"
#include "pipeline/files/text.h"
#include "pipeline/program/nearest_name.h"
#include "pipeline/program/option_values.h"

namespace regrade {
namespace {

namespace po = boost::program_options;
using Words = std::vector<std::string>;

// The text behind the one of `beginnings` that it has, see OptionInfo::runs; nothing without.
std::optional<std::string> Behind(const std::string& text, const char* beginnings) {
  std::optional<std::string> found;
  for (const std::string& beginning : Split(beginnings, '|')) {
    if (beginning.empty()) continue;
    if (beginning == "!" + text) return std::nullopt;
    if (beginning == "*" && !text.empty())
      found = text;
    else if (beginning != "*" && text.starts_with(beginning))
      found = text.substr(beginning.size());
  }
  return found;
}

}  // namespace

void OptionSet::AddEntry(Entry entry) {
  REGRADE_CHECK(Find(entry.name) == nullptr);
  entry.plain = ValueOf(entry);
  entries_.push_back(std::move(entry));
}

const OptionSet::Entry* OptionSet::Find(const std::string& name) const {
  for (const Entry& entry : entries_)
    if (entry.name == name) return &entry;
  return nullptr;
}

OptionSet::Entry* OptionSet::Find(const std::string& name) {
  return const_cast<Entry*>(std::as_const(*this).Find(name));
}

std::vector<std::string> OptionSet::Names() const {
  std::vector<std::string> names = {"help"};
  for (const Entry& entry : entries_)
    if (IsFlag(entry)) names.push_back(entry.name);
  return names;
}

std::vector<std::string> OptionSet::Parse(const std::vector<std::string>& arguments) {
  po::options_description description;
  for (const Entry& entry : entries_) {
    const bool is_switch = std::holds_alternative<bool*>(entry.target);
    description.add_options()(entry.name.c_str(), new po::untyped_value(is_switch));
    if (is_switch)
      description.add_options()(("no-" + entry.name).c_str(), new po::untyped_value(true));
  }
  constexpr const char* kSeeHelp = "see --help";
  const auto flags_end = std::ranges::find(arguments, "--");
  po::parsed_options parsed(&description);
  try {
    namespace style = po::command_line_style;
    // Accepts words that are no flags.
    po::positional_options_description positional;
    positional.add("word", -1);
    parsed = po::command_line_parser(Words(arguments.begin(), flags_end))
                 .options(description)
                 .positional(positional)
                 .style(style::allow_long | style::long_allow_adjacent | style::long_allow_next)
                 .run();
  } catch (const po::unknown_option& error) {
    std::string typed = error.get_option_name();
    typed.erase(0, typed.find_first_not_of('-'));
    typed.erase(std::min(typed.find('='), typed.size()));
    const std::string nearest = NearestName(typed, Names());
    throw UsageError("unknown option", "--" + typed,
                     nearest.empty() ? kSeeHelp : "did you mean --" + nearest + "?");
  } catch (const po::error_with_option_name& error) {
    std::string name = error.get_option_name();
    name.erase(0, name.find_first_not_of('-'));
    const Entry* entry = Find(name);
    const bool is_switch = entry == nullptr || std::holds_alternative<bool*>(entry->target);
    throw UsageError(is_switch ? "takes no value" : "its value is missing", "--" + name,
                     kSeeHelp);
  } catch (const po::error& error) {
    throw UsageError(error.what(), "", kSeeHelp);
  }

  std::vector<std::string> rest;
  for (const po::option& option : parsed.options) {
    if (option.position_key >= 0 || option.string_key.empty()) {
      for (const std::string& word : option.value) {
        if (word.size() > 1 && word[0] == '-')
          throw UsageError("unknown option", word,
                           "options begin with two dashes; write a file of this name after --");
        rest.push_back(word);
      }
      continue;
    }
    Flag flag{option.string_key, option.value.empty() ? "true" : option.value[0]};
    if (option.value.empty() && Find(flag.name) == nullptr)
      flag = {flag.name.substr(std::strlen("no-")), "false"};
    if (const Entry& entry = *Find(flag.name); !IsFlag(entry))
      throw UsageError(
          "is a constant, not a flag", "--" + flag.name,
          Concat("give --config '", DumpJson(AsConfig(flag.name, flag.value), -1), "'"));
    if (Given(flag.name) && !IsTextList(*Find(flag.name)))
      throw UsageError("given twice", "--" + flag.name, "keep one of them");
    flags_.push_back(flag);
  }
  if (flags_end != arguments.end()) rest.insert(rest.end(), flags_end + 1, arguments.end());
  return rest;
}

std::optional<std::string> OptionSet::Given(const std::string& name) const {
  for (const Flag& flag : flags_)
    if (flag.name == name) return flag.value;
  return std::nullopt;
}

void OptionSet::Replace(const std::string& name, const std::string& value) {
  for (Flag& flag : flags_)
    if (flag.name == name) flag.value = value;
}

void OptionSet::Assign(const Entry& entry, const std::string& text, const std::string& where) {
  const OptionInfo& info = entry.info;
  std::visit(
      [&](auto* target) {
        using T = std::remove_pointer_t<decltype(target)>;
        if constexpr (std::is_same_v<T, bool>) {
          *target = ParseSwitch(text, where);
        } else if constexpr (std::is_same_v<T, std::string>) {
          *target = ParseChoice(text, info, where);
        } else if constexpr (std::is_same_v<T, std::vector<int>>) {
          std::vector<int> values;
          const bool none = info.may_be_empty && text.empty();
          for (const std::string& part : none ? std::vector<std::string>() : Split(text, ','))
            values.push_back(ParseNumber<int>(part, info, where));
          *target = values;
        } else if constexpr (std::is_same_v<T, std::vector<std::string>>) {
          target->push_back(text);
        } else {
          *target = ParseNumber<T>(text, info, where);
        }
      },
      entry.target);
}

void OptionSet::ApplyConfig(const JsonValue& values, const std::string& where) {
  const auto place = [&where](const JsonValue& value) {
    return value.line() == 0 ? where : Concat(where, ":", value.line(), ":", value.column());
  };
  if (!values.IsObject()) throw UsageError("an object of options expected", place(values));
  for (const auto& [name, value] : values.AsObject()) {
    Entry* const entry = Find(name);
    if (entry == nullptr) {
      Words all = {};
      for (const Entry& known : entries_) all.push_back(known.name);
      const std::string nearest = NearestName(name, all);
      throw UsageError("unknown option \"" + name + "\"", place(value),
                       nearest.empty() ? "see --help" : "did you mean \"" + nearest + "\"?");
    }
    if (value.IsObject() || value.IsNull())
      throw UsageError("a value expected for \"" + name + "\"", place(value));
    const std::string where_of = place(value) + ": " + name;
    entry->set_by = where;
    if (IsTextList(*entry)) std::get<std::vector<std::string>*>(entry->target)->clear();
    if (!IsTextList(*entry) || value.IsString()) {  // one text is a list of one
      Assign(*entry, FlagText(value), where_of);
      continue;
    }
    if (!value.IsArray()) throw UsageError("a text or an array of texts expected", where_of);
    for (const JsonValue& element : value.AsArray()) {
      if (!element.IsString()) throw UsageError("a text expected", where_of);
      Assign(*entry, element.AsString(), where_of);
    }
  }
}

void OptionSet::ApplyFlags() {
  for (const Flag& flag : flags_)
    if (const Entry* entry = Find(flag.name); IsTextList(*entry))
      std::get<std::vector<std::string>*>(entry->target)->clear();
  for (const Flag& flag : flags_) {
    Entry* const entry = Find(flag.name);
    Assign(*entry, flag.value, "--" + flag.name);
    entry->set_by = kFlag;
  }
}

const std::string& OptionSet::SetBy(const std::string& name) const {
  static const std::string kNobody;
  const Entry* const entry = Find(name);
  return entry != nullptr ? entry->set_by : kNobody;
}

JsonValue OptionSet::Setters() const {
  JsonValue setters = JsonValue::Object();
  for (const Entry& entry : entries_)
    if (!entry.set_by.empty() &&
        (!entry.set_by.starts_with(kPresetOf) || !(ValueOf(entry) == entry.plain)))
      setters[entry.name] = entry.set_by;
  return setters;
}

void OptionSet::NoteSetters(const JsonValue& setters) {
  for (const auto& [name, by] : setters.AsObject())
    if (Entry* const entry = Find(name); entry != nullptr && !entry->set_by.empty())
      entry->set_by = by.AsString();
}

JsonValue OptionSet::ValueOf(const Entry& entry) {
  return std::visit(
      [](auto* target) -> JsonValue {
        using T = std::remove_pointer_t<decltype(target)>;
        if constexpr (std::is_same_v<T, std::vector<int>>) {
          JsonValue::Array array;
          for (const int value : *target) array.emplace_back(value);
          return array;
        } else if constexpr (std::is_same_v<T, std::vector<std::string>>) {
          JsonValue::Array array;
          for (const std::string& value : *target) array.emplace_back(value);
          return array;
        } else if constexpr (std::is_same_v<T, float>) {
          return ShortestDouble(*target);
        } else {
          return *target;
        }
      },
      entry.target);
}

std::vector<OptionSet::Outside> OptionSet::OutsideOf(const JsonValue& values) const {
  std::vector<Outside> all;
  if (!values.IsObject()) return all;
  for (const auto& [name, value] : values.AsObject()) {
    const Entry* const entry = Find(name);
    if (entry == nullptr || value.IsObject()) continue;
    const auto add = [&](const JsonValue& part) {
      const std::string text = FlagText(part);
      if (Behind(text, entry->info.runs))
        all.push_back({entry->name, text, ""});
      else if (const auto path = Behind(text, entry->info.reads))
        all.push_back({entry->name, text, *path});
    };
    if (value.IsArray() && IsTextList(*entry))
      for (const JsonValue& part : value.AsArray()) add(part);
    else
      add(value);
  }
  return all;
}

bool OptionSet::IsOnce(const std::string& name) const {
  const Entry* const entry = Find(name);
  return entry != nullptr && entry->info.once;
}

bool OptionSet::IsConstant(const std::string& name) const {
  const Entry* const entry = Find(name);
  return entry != nullptr && entry->info.constant;
}

JsonValue OptionSet::Values() const {
  JsonValue values = JsonValue::Object();
  for (const Entry& entry : entries_) values[entry.name] = ValueOf(entry);
  return values;
}

OptionSet::Description OptionSet::Describe(const Entry& entry, const Texts& required) {
  const bool is_switch = std::holds_alternative<bool*>(entry.target);
  const bool is_text = std::holds_alternative<std::string*>(entry.target) || IsTextList(entry);
  const char* choices = entry.info.choices + (*entry.info.choices == '|' ? 1 : 0);
  Description description;
  if (!is_switch) description.value = *choices ? choices : is_text ? "TEXT" : "N";
  std::string facts;
  if (!is_switch && *entry.info.unit) facts += std::string(entry.info.unit) + ", ";
  if (!is_switch && !is_text &&
      (std::isfinite(entry.info.min) || std::isfinite(entry.info.max)))
    facts += BoundsText(entry.info) + ", ";
  const std::string value = FlagText(ValueOf(entry));
  if (std::ranges::find(required, entry.name) != required.end())
    facts += "required";
  else
    facts += "default " + (is_switch       ? (value == "true" ? "on" : "off")
                           : value.empty() ? "none"
                                           : value);
  description.sentence = std::string(entry.info.help) + " (" + facts + ")";
  return description;
}

template <typename Shown>
std::string OptionSet::HelpOf(const Texts& required, bool headed, const char* dashes,
                              const Shown& shown) const {
  std::string text, heading;
  for (const Entry& entry : entries_) {
    if (!shown(entry)) continue;
    if (headed && (entry.heading != heading || text.empty()))
      text += "\n" + entry.heading + ":\n";
    heading = entry.heading;
    const Description description = Describe(entry, required);
    std::string head = Concat("  ", dashes, entry.name);
    if (!description.value.empty()) head += " " + description.value;
    constexpr size_t kIndent = 28, kWidth = 96;
    if (head.size() + 2 > kIndent) {
      head += '\n';
      head.append(kIndent, ' ');
    } else {
      head.resize(kIndent, ' ');
    }
    text += head + Wrapped(description.sentence, kIndent, kWidth) + "\n";
  }
  return text;
}

std::string OptionSet::Help(const Texts& required, const Texts& only) const {
  return HelpOf(required, only.empty(), "--", [&](const Entry& entry) {
    return only.empty() ? IsFlag(entry) : std::ranges::find(only, entry.name) != only.end();
  });
}

std::string OptionSet::HelpOfConstants() const {
  return HelpOf({}, true, "", [&](const Entry& entry) { return !IsFlag(entry); });
}

int OptionSet::count() const {
  return static_cast<int>(
      std::ranges::count_if(entries_, [this](const Entry& entry) { return IsFlag(entry); }));
}

std::string OptionSet::ManPage(const Texts& required) const {
  std::string text, heading;
  // A dash that is typed, and a line that is no request.
  const auto escaped = [](const std::string& plain) {
    std::string result;
    for (const char c : plain)
      result += c == '-' ? "\\-" : c == '\\' ? "\\e" : std::string(1, c);
    return result;
  };
  for (const Entry& entry : entries_) {
    if (!IsFlag(entry)) continue;
    if (entry.heading != heading) text += ".PP\n" + entry.heading + ":\n";
    heading = entry.heading;
    const Description description = Describe(entry, required);
    text += ".TP\n.B " + escaped("--" + entry.name);
    if (!description.value.empty()) text += " \\fI" + escaped(description.value) + "\\fR";
    text += "\n\\&" + escaped(description.sentence) + "\n";
  }
  return text;
}

std::string OptionSet::CompletionWords() const {
  std::string text;
  for (const Entry& entry : entries_) {
    if (!IsFlag(entry)) continue;
    text += "--" + entry.name;
    for (const std::string& choice : Split(entry.info.choices, '|'))
      if (!choice.empty()) text += " " + choice;
    text += "\n";
  }
  return text;
}

}  // namespace regrade
