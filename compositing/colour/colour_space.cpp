#include "compositing/colour/colour_space.h"

#include <OpenEXR/ImfChromaticities.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "core/base/status.h"
#include "core/process/module.h"

namespace glasswing {
namespace {

struct KnownSpace {
  const char* interop_id;
  std::array<float, 8> chromaticities;
};
// Linear light, by the Color Interop Forum's names. ACES: SMPTE ST 2065-1 and AMPAS S-2014-004.
constexpr std::array<KnownSpace, 5> kKnown{
    {{"lin_rec709_scene", {0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f}},
     {"lin_ap1_scene", {0.713f, 0.293f, 0.165f, 0.830f, 0.128f, 0.044f, 0.32168f, 0.33767f}},
     {"lin_ap0_scene", {0.7347f, 0.2653f, 0.0f, 1.0f, 0.0001f, -0.0770f, 0.32168f, 0.33767f}},
     {"lin_rec2020_scene", {0.708f, 0.292f, 0.170f, 0.797f, 0.131f, 0.046f, 0.3127f, 0.3290f}},
     {"lin_p3d65_scene", {0.680f, 0.320f, 0.265f, 0.690f, 0.150f, 0.060f, 0.3127f, 0.3290f}}}};

// Imath's matrices are multiplied from the left.
Imath::M44f bradford(const Imath::V3f& from_white, const Imath::V3f& to_white) {
  const Imath::M44f cones(0.8951f, -0.7502f, 0.0389f, 0, 0.2664f, 1.7135f, -0.0685f, 0, -0.1614f, 0.0367f,
                          1.0296f, 0, 0, 0, 0, 1);
  const Imath::V3f from = from_white * cones, to = to_white * cones;
  Imath::M44f scale;
  scale.setScale(Imath::V3f(to.x / from.x, to.y / from.y, to.z / from.z));
  return cones * scale * cones.inverse();
}
Imath::V3f white_of(const Imf::Chromaticities& space) {
  return {space.white.x / space.white.y, 1.0f, (1.0f - space.white.x - space.white.y) / space.white.y};
}
Imath::M44f rec709_of(const std::array<float, 8>& xy) {
  const Imf::Chromaticities space({xy[0], xy[1]}, {xy[2], xy[3]}, {xy[4], xy[5]}, {xy[6], xy[7]}), rec709;
  return Imf::RGBtoXYZ(space, 1.0f) * bradford(white_of(space), white_of(rec709)) *
         Imf::XYZtoRGB(rec709, 1.0f);
}

// Which known space a conversion to linear Rec. 709 starts from; null: a different one, or not linear light.
const KnownSpace* find_known(const ColourConversion& to_linear) {
  constexpr float kTolerance = 1e-3f;  // configs' matrices have four digits or more
  const std::vector<Imath::V3f> probes{{1, 0, 0},          {0, 1, 0},    {0, 0, 1},
                                       {0.2f, 0.2f, 0.2f}, {2, 0.5f, 1}, {0.01f, 0.02f, 0.005f}};
  std::vector<float> light;
  for (const Imath::V3f& probe : probes) light.insert(light.end(), {probe.x, probe.y, probe.z});
  to_linear.apply(light);
  const auto* const found = std::ranges::find_if(kKnown, [&](const KnownSpace& known) {
    const Imath::M44f matrix = rec709_of(known.chromaticities);
    for (size_t i = 0; i < probes.size(); ++i) {
      const Imath::V3f expected = probes[i] * matrix;
      for (unsigned c = 0; c < 3; ++c) {
        if (std::abs(light[3 * i + c] - expected[static_cast<int>(c)]) > kTolerance * probes[i].length())
          return false;
      }
    }
    return true;
  });
  return found != kKnown.end() ? found : nullptr;
}

absl::StatusOr<std::unique_ptr<const ColourConversion>> conversion(const std::string& config,
                                                                   const std::string& name, bool to_linear) {
  GW_ASSIGN_OR_RETURN(const ColourModule* const module, colour_module());
  std::string error;
  std::unique_ptr<const ColourConversion> made(module->conversion(config, name, to_linear, error));
  std::ranges::replace(error, '\n', ' ');
  if (made == nullptr) return absl::InvalidArgumentError(error);
  return made;
}

}  // namespace

absl::StatusOr<const ColourModule*> colour_module() {
  static const absl::StatusOr<const void*> kModule =
      load_module("glasswing-colours.so", "glasswing_colour_module");
  GW_RETURN_IF_ERROR(kModule.status());
  return static_cast<const ColourModule*>(*kModule);
}

absl::StatusOr<ColourSpace> ColourSpace::open(const std::string& config, const std::string& name) {
  ColourSpace space;
  GW_ASSIGN_OR_RETURN(space.to_linear_, conversion(config, name, true));
  GW_ASSIGN_OR_RETURN(space.from_linear_, conversion(config, name, false));
  space.colour_.space = name;
  if (const KnownSpace* const known = find_known(*space.to_linear_)) {
    space.colour_.interop_id = known->interop_id;
    space.colour_.chromaticities = known->chromaticities;
  }
  return space;
}

void ColourSpace::to_linear(RadianceImage& picture) const {
  to_linear_->apply(picture.samples);
}

void ColourSpace::from_linear(RadianceImage& picture) const {
  from_linear_->apply(picture.samples);
}

}  // namespace glasswing
