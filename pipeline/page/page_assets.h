// The page's own files, embedded when the program is built.
#pragma once

namespace regrade {

extern const char kPageTemplate[], kPageCss[], kPageScript[];
extern const char kOpenTemplate[], kOpenScript[];
// SHA-256 in hexadecimal digits.
extern const char kPageCssHash[], kPageScriptHash[], kOpenScriptHash[];

}  // namespace regrade
