// Reads names and numbers out of an option's text, such as "back=1920x1080@60". A number that its type cannot
// hold, or that is not finite, is an error like any other: what is given is never cut to what fits.
#pragma once

#include <charconv>
#include <cmath>
#include <string>
#include <string_view>
#include <type_traits>

namespace glasswing {

class Scanner {
 public:
  explicit Scanner(std::string_view text) : rest_(text) {}

  // Text up to `end`, which is read too: one character or more.
  Scanner& name(std::string& name, char end) {
    const size_t length = rest_.find(end);
    good_ = good_ && length != std::string_view::npos && length > 0;
    if (!good_) return *this;
    name = rest_.substr(0, length);
    rest_.remove_prefix(length + 1);
    return *this;
  }
  Scanner& then(std::string_view literal) {
    good_ = good_ && rest_.starts_with(literal);
    if (good_) rest_.remove_prefix(literal.size());
    return *this;
  }
  template <typename Number>
  Scanner& number(Number& value) {
    if (std::is_floating_point_v<Number> && rest_.size() > 1 && rest_[0] == '+' && rest_[1] != '-')
      rest_.remove_prefix(1);
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    good_ = good_ && error == std::errc();
    if constexpr (std::is_floating_point_v<Number>) good_ = good_ && std::isfinite(value);
    if (good_) rest_.remove_prefix(end - rest_.data());
    return *this;
  }
  // What is left, all of it.
  std::string_view rest() const { return rest_; }
  bool more() const { return good_ && !rest_.empty(); }
  // Everything was read, and nothing was wrong.
  bool done() const { return good_ && rest_.empty(); }

 private:
  std::string_view rest_;
  bool good_ = true;
};

}  // namespace glasswing
