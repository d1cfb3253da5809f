// Checks every call of a listening daemon against the table of roles (roles.h), and against the share of
// calls that its caller's certificate has (call_shares.h). Methods of other packages (health, reflection) are
// open to every certificate.
//
// A call with a login (login.h) is one that the console makes for a person, and gets that person's roles and
// name instead of the console's: the certificate must have the role console then. Without TLS only such calls
// are checked.
#pragma once

#include <grpcpp/security/auth_metadata_processor.h>

#include <memory>

#include "core/security/login.h"

namespace glasswing {

// Without `principal_of` no call may have a login.
std::shared_ptr<grpc::AuthMetadataProcessor> role_gate(PrincipalOf principal_of);

}  // namespace glasswing
