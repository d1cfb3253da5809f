#include <OpenColorIO/OpenColorIO.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <memory>
#include <stdexcept>

#include "compositing/colour/colour_module.h"

namespace glasswing {
namespace {

namespace ocio = OCIO_NAMESPACE;

class Conversion final : public ColourConversion {
 public:
  explicit Conversion(ocio::ConstCPUProcessorRcPtr processor) : processor_(std::move(processor)) {}
  void apply(std::span<float> rgb) const override {
    // OpenColorIO counts pixels in longs, of a picture of one line here.
    ocio::PackedImageDesc picture(rgb.data(), static_cast<long>(rgb.size() / 3), 1, 3);
    processor_->apply(picture);
  }

 private:
  ocio::ConstCPUProcessorRcPtr processor_;
};

ocio::ConstConfigRcPtr config_of(const std::string& file) {
  if (!file.empty()) return ocio::Config::CreateFromFile(file.c_str());
  const char* const variable = std::getenv("OCIO");
  if (variable == nullptr || *variable == '\0')
    throw std::runtime_error("there is no OpenColorIO config: --ocio-config must name one, or $OCIO");
  return ocio::Config::CreateFromFile(variable);
}

std::string names_in(const ocio::Config& config) {
  std::string names;
  for (int i = 0; i < config.getNumColorSpaces(); ++i)
    names += (i > 0 ? ", " : "") + std::string(config.getColorSpaceNameByIndex(i));
  return names;
}

// To linear Rec. 709 from the space that the config's role names, which all configs of version 2 should have.
constexpr const char* kInterchange = "aces_interchange";  // ACES2065-1
ocio::TransformRcPtr rec709_of_aces() {
  const ocio::BuiltinTransformRcPtr xyz = ocio::BuiltinTransform::Create();
  xyz->setStyle("UTILITY - ACES-AP0_to_CIE-XYZ-D65_BFD");
  // XYZ of Rec. 709's primaries and D65, inverted.
  const std::array<double, 16> to_xyz{0.4123907992659595,
                                      0.357584339383878,
                                      0.1804807884018343,
                                      0.0,
                                      0.2126390058715104,
                                      0.715168678767756,
                                      0.0721923153607337,
                                      0.0,
                                      0.0193308187155918,
                                      0.119194779794626,
                                      0.9505321522496606,
                                      0.0,
                                      0.0,
                                      0.0,
                                      0.0,
                                      1.0};
  const ocio::MatrixTransformRcPtr rgb = ocio::MatrixTransform::Create();
  rgb->setMatrix(to_xyz.data());
  rgb->setDirection(ocio::TRANSFORM_DIR_INVERSE);
  const ocio::GroupTransformRcPtr group = ocio::GroupTransform::Create();
  group->appendTransform(xyz);
  group->appendTransform(rgb);
  return group;
}

// Names that configs have for linear Rec. 709.
const char* rec709_in(const ocio::Config& config) {
  static constexpr std::array kNames{"lin_rec709_scene", "lin_rec709", "Linear Rec.709 (sRGB)",
                                     "Utility - Linear - sRGB", "lin_srgb"};
  const auto* const found =
      std::ranges::find_if(kNames, [&](const char* name) { return config.getColorSpace(name) != nullptr; });
  return found != kNames.end() ? *found : nullptr;
}

ocio::ConstProcessorRcPtr processor_of(const ocio::Config& config, const std::string& space) {
  const ocio::ConstColorSpaceRcPtr known = config.getColorSpace(space.c_str());
  if (known == nullptr)
    throw std::runtime_error("the OpenColorIO config has no colour space \"" + space +
                             "\"; it has: " + names_in(config));
  if (known->isData())
    throw std::runtime_error("the colour space \"" + space + "\" is for data, not for colours");
  const char* const by_name = rec709_in(config);
  if (!config.hasRole(kInterchange) && by_name == nullptr)
    throw std::runtime_error(
        "the OpenColorIO config does not say which of its spaces is linear Rec. 709: it needs the role "
        "aces_interchange, or a colour space lin_rec709");
  const ocio::GroupTransformRcPtr group = ocio::GroupTransform::Create();
  const ocio::ColorSpaceTransformRcPtr to = ocio::ColorSpaceTransform::Create();
  to->setSrc(space.c_str());
  to->setDst(config.hasRole(kInterchange) ? kInterchange : by_name);
  group->appendTransform(to);
  if (config.hasRole(kInterchange)) group->appendTransform(rec709_of_aces());
  return config.getProcessor(group);
}

}  // namespace
}  // namespace glasswing

extern "C" const glasswing::ColourModule glasswing_colour_module;
const glasswing::ColourModule glasswing_colour_module{
    .conversion = [](const std::string& file, const std::string& space, bool to_linear,
                     std::string& error) -> glasswing::ColourConversion* {
      using namespace glasswing;
      try {
        ocio::SetLoggingLevel(ocio::LOGGING_LEVEL_NONE);  // or it writes to the terminal
        const ocio::ConstConfigRcPtr config = config_of(file);
        const ocio::ConstProcessorRcPtr processor = processor_of(*config, space);
        const ocio::GroupTransformRcPtr group = processor->createGroupTransform();
        const ocio::ConstProcessorRcPtr directed = config->getProcessor(
            group, to_linear ? ocio::TRANSFORM_DIR_FORWARD : ocio::TRANSFORM_DIR_INVERSE);
        return new Conversion(directed->getOptimizedCPUProcessor(ocio::OPTIMIZATION_LOSSLESS));
      } catch (const std::exception& failure) {
        error = failure.what();
        return nullptr;
      }
    }};
