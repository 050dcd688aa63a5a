#pragma once
// How calibration speaks: input it cannot use is refused with a sentence, what the user should know becomes a notice.
#include <cstdarg>
#include <cstdio>
#include <stdexcept>
#include <string>

namespace ctcr {

/// Something about a calibration that its user should know.
template <class Kind>
struct Notice {
  Kind kind;
  double value;      ///< the figure it is about, SI
  double limit;      ///< what that figure was held against
  std::string text;  ///< both in a sentence
};

/// A text as printf writes it. Real time: no.
[[gnu::format(printf, 1, 2)]] inline std::string sentence(const char* format, ...) {
  char text[512];
  std::va_list values;
  va_start(values, format);
  std::vsnprintf(text, sizeof text, format, values);
  va_end(values);
  return text;
}

/// @throws std::invalid_argument with `text` unless the condition holds.
inline void require(bool condition, const std::string& text) {
  if (!condition) throw std::invalid_argument(text);
}

}  // namespace ctcr
