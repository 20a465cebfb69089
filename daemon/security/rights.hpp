// Who may read and write which topics: the documents of DDS Security's access control (1.1, 9.4.1), written for our roles and read back.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/security/utc_time.hpp"

namespace booth::daemon {

/// What a participant of the fleet is for.
enum class Role {
  booth,    ///< publishes what one booth sees, hears commands for it
  viewer,   ///< hears booths, sends nothing
  console,  ///< hears booths and commands them
};
const char* role_name(Role role);
std::optional<Role> role_of(const std::string& name);

/// Common name of a participant's certificate: "booth.lobby", "viewer.wall", "console.desk".
std::string identity_name(Role role, const std::string& name);
struct IdentityName {
  Role role;
  std::string name;
};
std::optional<IdentityName> parse_identity_name(const std::string& common_name);

/// One allowance. Topics and partitions may hold the wildcards of fnmatch(); without partitions the rule means the default one, the nameless.
struct TopicRule {
  bool publish = false;
  std::vector<std::string> topics, partitions;
};

/// What the role needs and no more: `booths` are booth.ids, of a viewer and a console also "*". A booth's list is itself.
std::vector<TopicRule> rules_for(Role role, const std::vector<std::string>& booths);

/// XML that allows `rules` to whoever holds a certificate with that common name, and denies everything else.
std::string permissions_xml(const std::string& common_name, const std::vector<TopicRule>& rules, const Validity& valid);

/// XML that says how a domain is protected: nobody joins without credentials, everything is encrypted, and each writer proves itself to each reader.
std::string governance_xml();

struct PermissionFacts {
  std::string subject;  ///< as the document writes it, "CN=booth.lobby"
  Validity valid;
  std::vector<TopicRule> rules;  ///< only what is allowed
  bool denies_the_rest = false;
};

/// First grant of a permissions document. Throws std::runtime_error where there is none.
PermissionFacts read_permissions(const std::string& xml);

/// What makes a governance document weaker than ours, as sentences; empty when nothing does.
std::vector<std::string> governance_weaknesses(const std::string& xml);

}  // namespace booth::daemon
