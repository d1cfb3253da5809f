// Shorthand for absl::Status plumbing.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <utility>

#define GW_RETURN_IF_ERROR(expression)                                            \
  do {                                                                            \
    if (absl::Status gw_status = (expression); !gw_status.ok()) return gw_status; \
  } while (false)

#define GW_ASSIGN_OR_RETURN(declaration, expression) \
  GW_ASSIGN_OR_RETURN_IMPL(GW_CONCAT(gw_result_, __LINE__), declaration, expression)
#define GW_ASSIGN_OR_RETURN_IMPL(result, declaration, expression) \
  auto result = (expression);                                     \
  if (!result.ok()) return std::move(result).status();            \
  declaration = *std::move(result)
#define GW_CONCAT(a, b) GW_CONCAT_IMPL(a, b)
#define GW_CONCAT_IMPL(a, b) a##b
