#include "core/sim/board_scene.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace glasswing {
namespace {

constexpr int kFaces = 4, kColumns = 56, kRows = 40, kCellsASquare = 8;
constexpr double kHalfWidth = 31.0, kHalfHeight = 24.0;  // of a face, in cells
// Of the column about its own axis, and of the prints on its faces, where they were not stuck on quite
// straight.
constexpr double kTurned_rad = 7.0 * std::numbers::pi / 180.0, kAskew_rad = 5.0 * std::numbers::pi / 180.0;

// The prints of the faces, rows from the top: bit 55 is the leftmost cell; 1 is white.
constexpr std::array<std::array<std::uint64_t, kRows>, kFaces> kPrints{{
    {{0x00ff00ff00ff00, 0x00810081008100, 0x00ad0081008d00, 0x009500bd008d00, 0x008d00a5008900,
      0x008900a900b500, 0x00810081008100, 0x00ff00ff00ff00, 0xff00ff00ff00ff, 0x81008100810081,
      0xa50095009d00a5, 0xa5009100a500b9, 0x9100a500b10089, 0x9900b900b500b9, 0x81008100810081,
      0xff00ff00ff00ff, 0x00ff00ff00ff00, 0x00810081008100, 0x00b100bd00b100, 0x009100b900bd00,
      0x00bd00b5009500, 0x008900a9009900, 0x00810081008100, 0x00ff00ff00ff00, 0xff00ff00ff00ff,
      0x81008100810081, 0xbd008500810089, 0xa5008500b900a9, 0xa500a900ad0081, 0x85009d009d00bd,
      0x81008100810081, 0xff00ff00ff00ff, 0x00ff00ff00ff00, 0x00810081008100, 0x00890089009100,
      0x00910099009900, 0x00ad008d009900, 0x008500b9009500, 0x00810081008100, 0x00ff00ff00ff00}},
    {{0x00ff00ff00ff00, 0x00810081008100, 0x00990099009d00, 0x009900b1009900, 0x0081009500a900,
      0x008100b900bd00, 0x00810081008100, 0x00ff00ff00ff00, 0xff00ff00ff00ff, 0x81008100810081,
      0xa100ad00b100b5, 0x99008100b100b5, 0xa1008900b500a1, 0xad00ad00950089, 0x81008100810081,
      0xff00ff00ff00ff, 0x00ff00ff00ff00, 0x00810081008100, 0x00bd00a500a900, 0x00b9009100b100,
      0x0091009d00b900, 0x009d0085009100, 0x00810081008100, 0x00ff00ff00ff00, 0xff00ff00ff00ff,
      0x81008100810081, 0xa90089008d0091, 0x95008500910091, 0x95008900990085, 0x91008d00bd0095,
      0x81008100810081, 0xff00ff00ff00ff, 0x00ff00ff00ff00, 0x00810081008100, 0x009500a500bd00,
      0x009d00b9008100, 0x00ad00b100b100, 0x008900bd00ad00, 0x00810081008100, 0x00ff00ff00ff00}},
    {{0x00ff00ff00ff00, 0x00810081008100, 0x00810081008500, 0x00a100a500a100, 0x00a90089009d00,
      0x00b900a5009500, 0x00810081008100, 0x00ff00ff00ff00, 0xff00ff00ff00ff, 0x81008100810081,
      0x81008100850085, 0x9100b500b1009d, 0xbd00bd00950085, 0xbd009900a900a1, 0x81008100810081,
      0xff00ff00ff00ff, 0x00ff00ff00ff00, 0x00810081008100, 0x0089008d008d00, 0x00a9008900a100,
      0x008900a100ad00, 0x00a100b1008900, 0x00810081008100, 0x00ff00ff00ff00, 0xff00ff00ff00ff,
      0x81008100810081, 0x89008900890091, 0x9100b900b500ad, 0xb900b9008d0099, 0xa100ad00bd0091,
      0x81008100810081, 0xff00ff00ff00ff, 0x00ff00ff00ff00, 0x00810081008100, 0x00950095009500,
      0x00810081008500, 0x0089008500a500, 0x00b9008d009100, 0x00810081008100, 0x00ff00ff00ff00}},
    {{0x00ff00ff00ff00, 0x00810081008100, 0x00950095009500, 0x009500b500bd00, 0x0099009100a500,
      0x00a10085009d00, 0x00810081008100, 0x00ff00ff00ff00, 0xff00ff00ff00ff, 0x81008100810081,
      0x99009900990099, 0xa100a100850085, 0x810099008900b9, 0x85009d009100a5, 0x81008100810081,
      0xff00ff00ff00ff, 0x00ff00ff00ff00, 0x00810081008100, 0x00990099009900, 0x00ad00bd009d00,
      0x008500b900b500, 0x0089009500bd00, 0x00810081008100, 0x00ff00ff00ff00, 0xff00ff00ff00ff,
      0x81008100810081, 0x9d00a100a100a1, 0xb90081008d00ad, 0x8500a9009100a9, 0xad008100910089,
      0x81008100810081, 0xff00ff00ff00ff, 0x00ff00ff00ff00, 0x00810081008100, 0x00a500a100a100,
      0x008d0091009500, 0x009d0099008900, 0x00a900b100a900, 0x00810081008100, 0x00ff00ff00ff00}},
}};

// Light of the room that paper and ink reflect.
constexpr float kPaper = 0.45f, kInk = 0.03f;

class BoardScene final : public Scene {
 public:
  explicit BoardScene(MonitorSize back)
      : cell_(kBoardSquare * back.width_px / kCellsASquare),
        // Not quite about the axis.
        middle_(table_centre("board", back) + cell_ * Vec3{1.5, -0.7, 1.1}) {
    for (int face = 0; face < kFaces; ++face) {
      const double turn_rad = kTurned_rad + face * 0.5 * std::numbers::pi;
      faces_[face] = {std::cos(turn_rad), 0.0, -std::sin(turn_rad)};
    }
  }
  std::optional<std::vector<Path>> trace(const Ray& ray, int, int) const override {
    if (!hit(ray)) return std::nullopt;
    return std::vector<Path>();  // opaque
  }
  Colour foreground(const Ray& ray) const override {
    const std::optional<Place> place = hit(ray);
    if (!place) return {};
    bool white = true;
    if (place->x >= 0.0 && place->x < kColumns && place->y >= 0.0 && place->y < kRows)
      white =
          kPrints[place->face][static_cast<int>(place->y)] >> (kColumns - 1 - static_cast<int>(place->x)) & 1;
    const float light = white ? kPaper : kInk;
    return {light, light, light};
  }
  bool is_colourless() const override { return true; }

 private:
  static constexpr Vec3 kDown{0.0, 1.0, 0.0};
  // Cells from a print's upper left corner.
  struct Place {
    int face;
    double x, y;
  };
  // The first face that a ray hits from outside.
  std::optional<Place> hit(const Ray& ray) const {
    for (int face = 0; face < kFaces; ++face) {
      const Vec3 inward = cross(faces_[face], kDown);
      const double speed = dot(ray.direction, inward);
      if (speed <= 0.0) continue;
      const Vec3 centre = middle_ - kHalfWidth * cell_ * inward;
      const double away = dot(centre - ray.origin, inward) / speed;
      const Vec3 p = ray.origin + away * ray.direction - centre;
      const double u = dot(p, faces_[face]) / cell_, v = dot(p, kDown) / cell_;
      if (away <= 0.0 || std::abs(u) > kHalfWidth || std::abs(v) > kHalfHeight) continue;
      const double c = std::cos(kAskew_rad), s = std::sin(kAskew_rad);
      return Place{face, 0.5 * kColumns + c * u + s * v, 0.5 * kRows + c * v - s * u};
    }
    return std::nullopt;
  }

  double cell_;
  Vec3 middle_;
  std::array<Vec3, kFaces> faces_{};  // along their rows
};

}  // namespace

std::unique_ptr<Scene> make_board(MonitorSize back) {
  return std::make_unique<BoardScene>(back);
}

}  // namespace glasswing
