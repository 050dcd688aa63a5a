#pragma once
// How a procedure reports: input that it cannot use is refused with a sentence, a doubt about its result is a notice.
#include <cstdarg>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

namespace ctcr {

/// A doubt about the result of a calibration.
template <class Kind>
struct Notice {
  Kind kind;
  double value;      ///< the figure that is doubtful, SI
  double limit;      ///< the limit that it exceeds
  std::string text;  ///< both in a sentence
};

namespace detail {
/// A text as vprintf writes it. Real time: no.
inline std::string formatted(const char* format, std::va_list values) {
  char text[512];
  std::vsnprintf(text, sizeof text, format, values);
  return text;
}
}  // namespace detail

template <class Kind>
struct Notices : std::vector<Notice<Kind>> {
  /// @param format  of the text, with what follows as printf takes it
  [[gnu::format(printf, 5, 6)]] void add(Kind kind, double value, double limit, const char* format, ...) {
    std::va_list values;
    va_start(values, format);
    this->push_back({kind, value, limit, detail::formatted(format, values)});
    va_end(values);
  }
};

/// @throws std::invalid_argument with a text as printf writes it unless the condition holds.
[[gnu::format(printf, 2, 3)]] inline void require(bool condition, const char* format, ...) {
  if (condition) return;
  std::va_list values;
  va_start(values, format);
  const std::string text = detail::formatted(format, values);
  va_end(values);
  throw std::invalid_argument(text);
}

}  // namespace ctcr
