// JSON as a value of our own: objects keep their order, parsed values know their line.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {

class JsonValue {
 public:
  using Array = std::vector<JsonValue>;
  using Member = std::pair<std::string, JsonValue>;
  using Object = std::vector<Member>;

  JsonValue() = default;  // null
  JsonValue(std::nullptr_t) {}
  JsonValue(bool value) : value_(value) {}
  JsonValue(int value) : value_(static_cast<int64_t>(value)) {}
  JsonValue(int64_t value) : value_(value) {}
  JsonValue(uint64_t value) : value_(value) {}
  JsonValue(double value) : value_(value) {}  // NaN and infinities are written as null
  JsonValue(const char* value) : value_(std::string(value)) {}
  JsonValue(std::string value) : value_(std::move(value)) {}
  JsonValue(Array value) : value_(std::move(value)) {}
  JsonValue(Object value) : value_(std::move(value)) {}

  bool IsNull() const { return std::holds_alternative<std::monostate>(value_); }
  bool IsNumber() const;
  bool IsString() const { return std::holds_alternative<std::string>(value_); }
  bool IsArray() const { return std::holds_alternative<Array>(value_); }
  bool IsObject() const { return std::holds_alternative<Object>(value_); }
  bool IsBool() const { return std::holds_alternative<bool>(value_); }

  // These throw Error(kInput) with the line where the value stands if it is something else.
  bool AsBool() const;
  int64_t AsInt() const;  // whole numbers in range
  double AsDouble() const;
  const std::string& AsString() const;
  const Array& AsArray() const;
  const Object& AsObject() const;
  // The member, which must be there.
  const JsonValue& At(std::string_view key) const;

  // Null pointer where it is not an object or has no such member.
  const JsonValue* Find(std::string_view key) const;
  // Makes an object of null; adds the member if it is new.
  JsonValue& operator[](std::string_view key);
  void Append(JsonValue element);  // makes an array of null

  // Values alone are compared; 1 and 1.0 are the same number.
  bool operator==(const JsonValue& other) const;

  int line() const { return line_; }  // 1-based, where it was parsed; 0: it was not
  int column() const { return column_; }
  void SetPosition(int line, int column) { line_ = line, column_ = column; }

  const auto& variant() const { return value_; }

 private:
  [[noreturn]] void RefuseKind(const char* expected) const;

  std::variant<std::monostate, bool, int64_t, uint64_t, double, std::string, Array, Object>
      value_;
  int line_ = 0, column_ = 0;
};

// UTF-8 text; a byte order mark is skipped. Refused with "line:column": syntax, invalid UTF-8,
// numbers out of range, keys that appear twice, more than 64 levels. `where` names the text;
// `code` is what the Error carries (configuration is usage, data is input).
JsonValue ParseJson(std::string_view text, const std::string& where,
                    ExitCode code = ExitCode::kInput);
JsonValue ReadJsonFile(const std::string& path, uint64_t max_bytes = 64 << 20,
                       ExitCode code = ExitCode::kInput);

// Doubles in the shortest form that reads back exactly. indent < 0: everything on one line.
// Strings that are not UTF-8 come out with replacement characters.
std::string DumpJson(const JsonValue& value, int indent = 1);
void WriteJsonFile(const std::string& path, const JsonValue& value);  // atomically

}  // namespace regrade
