#include "core/pattern/stimulus_kind.h"

#include <utility>

namespace glasswing {
namespace {

constexpr std::pair<StimulusKind, std::string_view> kNames[] = {
    {StimulusKind::kSolid, "solid"},       {StimulusKind::kStripe, "gauss_stripe"},
    {StimulusKind::kSinusoid, "sinusoid"}, {StimulusKind::kSquare, "square"},
    {StimulusKind::kRamp, "ramp"},         {StimulusKind::kPhoto, "photo"},
    {StimulusKind::kPatch, "patch"},
};

}  // namespace

StimulusKind kind_of(const v1::Stimulus& stimulus) {
  for (const auto& [kind, name] : kNames) {
    if (stimulus.kind() == name) return kind;
  }
  return StimulusKind::kUnknown;
}

std::string_view name_of(StimulusKind kind) {
  for (const auto& [own, name] : kNames) {
    if (own == kind) return name;
  }
  return "";
}

}  // namespace glasswing
