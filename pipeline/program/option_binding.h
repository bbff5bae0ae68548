// Turns option structs into flags: parsing, range checks, help and run.json from one
// description.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "kernels/base/options.h"
#include "pipeline/files/json_file.h"

namespace regrade {

class OptionSet {
 public:
  using Texts = std::vector<std::string>;
  // What options say of who set them: a flag, or a preset, whose name follows.
  static constexpr char kFlag[] = "flag", kPresetOf[] = "preset ";

  // `options` must outlive the set. `heading` is that of its part of the help, and nothing
  // else. Flag names must be unique within the set (checked).
  template <typename T>
  void Add(const std::string& heading, T* options) {
    Binder binder{this, heading};
    options->Describe(binder);
  }

  // Reads flags without changing the structs; returns the words that are no flags. Forms:
  // "--name value", "--name=value"; for switches "--name" and "--no-name"; "--" ends flags.
  // Throws Error(kUsage) for unknown names (with the nearest known one), a missing value, and a
  // flag given twice, unless it is a list of texts, and for a constant (OptionInfo).
  std::vector<std::string> Parse(const std::vector<std::string>& arguments);

  // The value of --name on the command line, the first of several.
  std::optional<std::string> Given(const std::string& name) const;
  // Gives --name another value, where it was given.
  void Replace(const std::string& name, const std::string& value);

  // Writes the values of a JSON object {"name": value, ...} into the structs. Throws
  // Error(kUsage) with line and column for unknown names and bad values.
  void ApplyConfig(const JsonValue& values, const std::string& where);
  // Writes the parsed flags into the structs. Throws Error(kUsage) with the allowed range for
  // values outside it, and for texts that are no number: NaN, 1e999, 0x10, 12abc.
  void ApplyFlags();

  // {"name": value, ...} of everything in effect.
  JsonValue Values() const;
  // Who set an option last: kFlag, or the `where` of ApplyConfig. Empty: it has its default.
  const std::string& SetBy(const std::string& name) const;
  // {"name": who set it, ...}; of what presets set, where it differs from the default.
  JsonValue Setters() const;
  // Takes over who set options, from the Setters() of an earlier start.
  void NoteSetters(const JsonValue& setters);

  // An option's text that leads out of a run's folder, see OptionInfo.
  struct Outside {
    std::string name, text;
    std::string path;  // that is read; empty for what runs
  };
  // Those among {"name": value, ...}; names that are not in the set are skipped.
  std::vector<Outside> OutsideOf(const JsonValue& values) const;
  // Is it an option of one start?
  bool IsOnce(const std::string& name) const;
  bool IsConstant(const std::string& name) const;

  // Names, units, effects, defaults and bounds, of the options named in `only`, or of all that
  // are flags. Call before flags are applied. `required`: names of options that the command
  // demands.
  std::string Help(const Texts& required = {}, const Texts& only = {}) const;
  // The same of what --config alone changes, without dashes; empty where there is nothing.
  std::string HelpOfConstants() const;
  // That of flags as the body of a section of a man page.
  std::string ManPage(const Texts& required = {}) const;
  // For completion: a line for each option, "--name" and its choices.
  std::string CompletionWords() const;
  int count() const;  // of flags

 private:
  using Target = std::variant<bool*, int*, int64_t*, uint64_t*, float*, double*, std::string*,
                              std::vector<int>*, std::vector<std::string>*>;
  struct Entry {
    std::string heading, name;
    Target target;
    OptionInfo info;
    JsonValue plain = {};  // the value when it was added
    std::string set_by = {};
  };
  struct Binder {
    OptionSet* set;
    std::string heading;
    template <typename T>
    void operator()(const char* name, T& member, const OptionInfo& info) {
      set->AddEntry({heading, name, &member, info});
    }
  };
  struct Flag {
    std::string name, value;
  };

  // What stands behind the name, and the sentence with unit, bounds and default.
  struct Description {
    std::string value, sentence;
  };
  static Description Describe(const Entry& entry, const Texts& required);
  // Lines of help, below headings if `headed`, of the entries that `shown` accepts.
  template <typename Shown>
  std::string HelpOf(const Texts& required, bool headed, const char* dashes,
                     const Shown& shown) const;
  bool IsFlag(const Entry& entry) const {
    return !entry.info.constant || Find("config") == nullptr;
  }

  void AddEntry(Entry entry);
  const Entry* Find(const std::string& name) const;
  Entry* Find(const std::string& name);
  std::vector<std::string> Names() const;
  static void Assign(const Entry& entry, const std::string& text, const std::string& where);
  static bool IsTextList(const Entry& entry) {
    return std::holds_alternative<std::vector<std::string>*>(entry.target);
  }
  static JsonValue ValueOf(const Entry& entry);

  std::vector<Entry> entries_;
  std::vector<Flag> flags_;
};

// {"name": value, ...} of option structs: what a stage's inputs hold of them.
template <typename... Options>
JsonValue OptionValues(Options... options) {
  OptionSet set;
  (set.Add("", &options), ...);
  return set.Values();
}

}  // namespace regrade
