#include "core/sim/board_scene.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace glasswing {
namespace {

constexpr int kColumns = 56, kRows = 40, kCellsASquare = 8, kMargin = 1;

// The print, rows from the top: bit 55 is the leftmost cell; 1 is white.
constexpr std::array<std::uint64_t, kRows> kPrint{
    0x00ff00ff00ff00, 0x00810081008100, 0x00ad0081008d00, 0x009500bd008d00, 0x008d00a5008900,
    0x008900a900b500, 0x00810081008100, 0x00ff00ff00ff00, 0xff00ff00ff00ff, 0x81008100810081,
    0xa50095009d00a5, 0xa5009100a500b9, 0x9100a500b10089, 0x9900b900b500b9, 0x81008100810081,
    0xff00ff00ff00ff, 0x00ff00ff00ff00, 0x00810081008100, 0x00b100bd00b100, 0x009100b900bd00,
    0x00bd00b5009500, 0x008900a9009900, 0x00810081008100, 0x00ff00ff00ff00, 0xff00ff00ff00ff,
    0x81008100810081, 0xbd008500810089, 0xa5008500b900a9, 0xa500a900ad0081, 0x85009d009d00bd,
    0x81008100810081, 0xff00ff00ff00ff, 0x00ff00ff00ff00, 0x00810081008100, 0x00890089009100,
    0x00910099009900, 0x00ad008d009900, 0x008500b9009500, 0x00810081008100, 0x00ff00ff00ff00};

constexpr double kLean_rad = 12.0 * std::numbers::pi / 180.0;
// Light of the room that paper, ink and the back of the plate reflect.
constexpr float kPaper = 0.45f, kInk = 0.03f, kBehind = 0.12f;

class BoardScene final : public Scene {
 public:
  explicit BoardScene(MonitorSize back)
      : cell_(kBoardSquare * back.width_px / kCellsASquare),
        down_{0.0, std::cos(kLean_rad), -std::sin(kLean_rad)},
        // Nearer to the camera than the axis, and beside it.
        middle_(table_centre("board", back) + cell_ * Vec3{-3.0, 0.0, -9.0}) {}
  std::optional<std::vector<Path>> trace(const Ray& ray, int, int) const override {
    if (!hit(ray)) return std::nullopt;
    return std::vector<Path>();  // opaque
  }
  Colour foreground(const Ray& ray) const override {
    const std::optional<Cell> cell = hit(ray);
    if (!cell) return {};
    float light = kPaper;
    if (dot(ray.direction, cross(kRight, down_)) < 0.0) {
      light = kBehind;
    } else if (cell->x >= 0.0 && cell->x < kColumns && cell->y >= 0.0 && cell->y < kRows) {
      const std::uint64_t row = kPrint[static_cast<int>(cell->y)];
      light = (row >> (kColumns - 1 - static_cast<int>(cell->x)) & 1) != 0 ? kPaper : kInk;
    }
    return {light, light, light};
  }
  bool is_colourless() const override { return true; }

 private:
  // Cells from the print's upper left corner.
  struct Cell {
    double x, y;
  };
  static constexpr Vec3 kRight{1.0, 0.0, 0.0};
  std::optional<Cell> hit(const Ray& ray) const {
    const Vec3 normal = cross(kRight, down_);
    const double away = dot(middle_ - ray.origin, normal) / dot(ray.direction, normal);
    if (!(away > 1e-9) || !std::isfinite(away)) return std::nullopt;
    const Vec3 p = ray.origin + away * ray.direction - middle_;
    const Cell cell{0.5 * kColumns + dot(p, kRight) / cell_, 0.5 * kRows + dot(p, down_) / cell_};
    if (cell.x < -kMargin || cell.x >= kColumns + kMargin || cell.y < -kMargin || cell.y >= kRows + kMargin)
      return std::nullopt;
    return cell;
  }

  double cell_;
  Vec3 down_, middle_;
};

}  // namespace

std::unique_ptr<Scene> make_board(MonitorSize back) {
  return std::make_unique<BoardScene>(back);
}

}  // namespace glasswing
