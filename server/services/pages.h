// Pages of lists, as in https://google.aip.dev/158: an answer stays far below gRPC's limit of 4 MiB however
// long the list is.
#pragma once

#include <absl/status/statusor.h>
#include <absl/strings/numbers.h>
#include <fmt/format.h>

#include <algorithm>
#include <string>

namespace glasswing {

// The part of an answer's lists that one page holds: as many items as requested, at most kMaxItems, and no
// more than kMaxBytes, but at least one. Its token is the number of items on earlier pages, so items that are
// added or removed in between may be listed twice or not at all.
class Page {
 public:
  static constexpr int kMaxItems = 500;
  static constexpr size_t kMaxBytes = size_t{1} << 20;

  // INVALID_ARGUMENT: page_size is negative, or page_token is invalid.
  template <typename Request>
  static absl::StatusOr<Page> of(const Request& request) {
    if (request.page_size() < 0) {
      return absl::InvalidArgumentError(
          fmt::format("page_size is {}; it must be 0 or more", request.page_size()));
    }
    int first = 0;
    const std::string& token = request.page_token();
    if (!token.empty() && (!absl::SimpleAtoi(token, &first) || first <= 0))
      return absl::InvalidArgumentError("page_token is not from this server");
    return Page(first, request.page_size() == 0 ? kMaxItems : std::min(request.page_size(), kMaxItems));
  }

  // Leaves the items of a list that belong to the page. The lists of an answer are cut one after the other,
  // always in the same order.
  template <typename Items>
  void cut(Items& items) {
    const int first = std::min(skipped_, items.size());
    skipped_ -= first;
    int end = first;
    while (end < items.size() && takes(items[end])) ++end;
    next_ += end - first;
    items.DeleteSubrange(end, items.size() - end);
    items.DeleteSubrange(0, first);
  }
  // Token of the next page; empty: all items were listed.
  std::string next_token() const { return full_ ? std::to_string(next_) : ""; }

 private:
  Page(int first, int size) : size_(size), skipped_(first), next_(first) {}

  template <typename Item>
  bool takes(const Item& item) {
    const size_t bytes = item.ByteSizeLong();
    full_ = full_ || (count_ > 0 && (count_ == size_ || bytes_ + bytes > kMaxBytes));
    bytes_ += bytes;
    ++count_;
    return !full_;
  }

  int size_, skipped_, next_;
  int count_ = 0;
  size_t bytes_ = 0;
  bool full_ = false;
};

}  // namespace glasswing
