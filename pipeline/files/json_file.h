// JSON values: objects keep their order, parsed values keep their file, line and column.
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

  // These throw Error(kInput) with the value's place if it has another type.
  bool AsBool() const;
  int64_t AsInt() const;  // whole numbers in range
  double AsDouble() const;
  const std::string& AsString() const;
  const Array& AsArray() const;
  const Object& AsObject() const;
  // The member; throws Error(kInput) if it is missing.
  const JsonValue& At(std::string_view key) const;

  // Null if this is not an object or has no such member.
  const JsonValue* Find(std::string_view key) const;
  // Makes an object of null; adds the member if it is new.
  JsonValue& operator[](std::string_view key);
  void Append(JsonValue element);  // makes an array of null

  // Positions are ignored; 1 equals 1.0.
  bool operator==(const JsonValue& other) const;

  int line() const { return line_; }  // 1-based; 0: not parsed from a text
  int column() const { return column_; }
  // `text` is the name of the text, and must stay.
  void SetPosition(const std::string* text, int line, int column) {
    text_ = text, line_ = line, column_ = column;
  }
  // "FILE, line LINE"; empty for a value that was not parsed.
  std::string Place() const;

  const auto& variant() const { return value_; }

 private:
  [[noreturn]] void RefuseKind(const char* expected) const;

  std::variant<std::monostate, bool, int64_t, uint64_t, double, std::string, Array, Object>
      value_;
  const std::string* text_ = nullptr;
  int line_ = 0, column_ = 0;
};

// Parses UTF-8 text; a byte order mark is skipped. Throws Error(`code`) with "line:column" for
// bad syntax, invalid UTF-8, numbers out of range, duplicate keys and more than 64 levels.
// `where` names the text in errors.
JsonValue ParseJson(std::string_view text, const std::string& where,
                    ExitCode code = ExitCode::kInput);
// "path:line:column", for errors.
std::string PlaceIn(const std::string& path, const JsonValue& at);
JsonValue ReadJsonFile(const std::string& path, uint64_t max_bytes = 64 << 20,
                       ExitCode code = ExitCode::kInput);

// Doubles get the shortest text that reads back exactly. indent < 0: everything on one line.
// Invalid UTF-8 becomes replacement characters.
std::string DumpJson(const JsonValue& value, int indent = 1);
void WriteJsonFile(const std::string& path, const JsonValue& value);  // atomically

}  // namespace regrade
