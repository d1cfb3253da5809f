#include "solver/background/mask_regions.h"

#include <algorithm>
#include <cstring>
#include <vector>

namespace glasswing {
namespace {

struct Run {
  std::uint8_t* row;
  int begin, end;
  int parent;   // itself for the first run of a region
  int area_px;  // of the region, kept at its first run
};

class Regions {
 public:
  // The runs of pixels of this value. `reach`: 1 if corners connect, 0 if only sides do.
  Regions(BinaryView mask, std::uint8_t value, int reach) {
    size_t above = 0;
    for (size_t first = 0; first < mask.samples.size(); first += static_cast<size_t>(mask.width_px)) {
      const size_t begin = runs_.size();
      add_row(mask.samples.data() + first, mask.width_px, value);
      join(above, begin, reach);
      above = begin;
    }
  }

  int region_of(size_t run) {
    int at = static_cast<int>(run);
    while (of(at).parent != at) at = of(at).parent = of(of(at).parent).parent;
    return at;
  }
  int area_px(int region) { return of(region).area_px; }
  size_t count() const { return runs_.size(); }
  void paint(size_t run, std::uint8_t value) const {
    const Run& each = runs_[run];
    std::memset(each.row + each.begin, value, static_cast<size_t>(each.end - each.begin));
  }

 private:
  Run& of(int run) { return runs_[run]; }

  void add_row(std::uint8_t* row, int width_px, std::uint8_t value) {
    const auto other = static_cast<std::uint8_t>(~value);
    const auto next = [&](int from, std::uint8_t wanted) {
      const void* const found = std::memchr(row + from, wanted, static_cast<size_t>(width_px - from));
      return found == nullptr ? width_px : static_cast<int>(static_cast<const std::uint8_t*>(found) - row);
    };
    for (int begin = next(0, value); begin < width_px;) {
      const int end = next(begin, other);
      runs_.push_back({row, begin, end, static_cast<int>(runs_.size()), end - begin});
      begin = next(end, value);
    }
  }

  // Joins the runs [above, below) of one row with those of the next.
  void join(size_t above, size_t below, int reach) {
    for (size_t upper = above, lower = below; upper < below && lower < runs_.size();) {
      const Run &a = runs_[upper], &b = runs_[lower];
      if (a.begin < b.end + reach && b.begin < a.end + reach) unite(upper, lower);
      ++(a.end < b.end ? upper : lower);
    }
  }

  void unite(size_t a, size_t b) {
    const int first = region_of(a), second = region_of(b);
    if (first == second) return;
    const auto [kept, joined] = std::minmax(first, second);
    of(joined).parent = kept;
    of(kept).area_px += of(joined).area_px;
  }

  std::vector<Run> runs_;
};

}  // namespace

void fill_holes(BinaryView mask) {
  Regions outside(mask, 0, 0);
  for (size_t run = 0; run < outside.count(); ++run) {
    if (outside.region_of(run) != 0) outside.paint(run, 255);
  }
}

void drop_specks(BinaryView mask, int min_px) {
  Regions regions(mask, 255, 1);
  for (size_t run = 0; run < regions.count(); ++run) {
    if (regions.area_px(regions.region_of(run)) < min_px) regions.paint(run, 0);
  }
}

}  // namespace glasswing
