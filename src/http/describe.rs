//! The API's description (OpenAPI 3.1), generated from the operations. What is the same for all of
//! them (who may, which problems any request can end in, what a problem looks like) is added here.
//!
//! An operation states its `operation_id` (a verb and what it acts on), one tag of [`TAGS`], a summary
//! and a description (the first line of its doc comment, and the rest), its own answers and refusals.
//! `tests/interop/openapi.sh` holds the description against the rules of Redocly and Spectral.

use axum::http::Method;
use utoipa::openapi::path::{HttpMethod, Operation, PathItem};
use utoipa::openapi::schema::{Schema, SchemaType, Type};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme};
use utoipa::openapi::tag::TagBuilder;
use utoipa::openapi::{
    Components, ContactBuilder, Content, ContentBuilder, Header, Info, InfoBuilder, LicenseBuilder, OpenApi,
    OpenApiBuilder, Ref, RefOr, Response, ResponseBuilder, Responses, ServerBuilder,
};
use utoipa::{PartialSchema, ToSchema};

use super::auth::{Access, access};
use super::problem::{MEDIA_TYPE, Problem};
use super::router;
use super::{about, octets};
use crate::pipeline::legend;

/// The security scheme's name.
const BEARER: &str = "bearer";

const ABOUT: &str = "\
Head CT in (C-STORE, STOW-RS, upload), the patient's skin as a point cloud out.\n\n\
Coordinates are DICOM patient coordinates, mm: LPS (left, posterior, superior), or RAS on request. \
Times are UTC. Errors are problem details (RFC 9457) whose `type` is a stable URN. Lists come in \
pages: pass `next_cursor` on as `cursor`.\n\n\
Where tokens are configured, send one as `Authorization: Bearer <token>`; where none are, none is \
needed. Roles: `upload` sends \
instances, completes series and starts reconstructions; `read` reads; `operate` does everything.\n\n\
Not a medical device.";

/// What any operation can end in, whatever it is.
const ANYWHERE: [(&str, &str); 4] = [
    ("400", "A parameter of the path or the query, or the Host header, is not valid."),
    ("421", "The host that is asked for is none of those that the service answers to."),
    ("500", "A failure of the service; its log has the cause, under this request's id."),
    ("503", "Busy, shutting down, or at a limit: try again later (Retry-After)."),
];

/// What a representation that can be asked for in parts can end in.
const CHANGED: &str = "It is another version than If-Match names.";

/// What an operation that needs a token can end in.
const PROTECTED: [(&str, &str); 2] =
    [("401", "No valid token (WWW-Authenticate)."), ("403", "The token's role does not allow this.")];

/// What an operation that changes something can end in.
const FOREIGN: &str = "The token's role does not allow this, or a page of another origin asks.";

/// How the paths of results end: their answers tell what they are of.
const RESULTS: [&str; 3] = ["/cloud", "/report", PICTURE];

/// What operations are grouped by; each has one of these.
const TAGS: [(&str, &str); 5] = [
    ("Series", "Sending a series, saying that it is complete, and what is there."),
    ("Reconstructions", "Starting, watching and removing reconstructions."),
    ("Results", "Clouds, reports and pictures."),
    ("DICOMweb", "Storing instances by STOW-RS (PS3.18 section 10.5)."),
    ("Operation", "Health, metrics and this description."),
];

/// How the path of the slices' pictures ends.
const PICTURE: &str = "/slices/{plane}/{picture}";

/// The description of the whole API, as `GET /openapi.json` and `triplanar openapi` give it.
#[must_use]
pub fn openapi() -> OpenApi {
    let (_, mut api) = router::operations().split_for_parts();
    for (path, item) in &mut api.paths.paths {
        for (method, operation) in operations_of(item) {
            complete(path, &method, operation);
            if RESULTS.iter().any(|end| path.ends_with(end)) {
                with_headers_of_results(operation);
            }
            octets::describe(operation);
            without_null(operation);
        }
    }
    let pictures = api.paths.paths.iter_mut().filter(|(path, _)| path.ends_with(PICTURE));
    for operation in pictures.filter_map(|(_, item)| item.get.as_mut()) {
        let colours = legend().into_iter().map(|(reason, colour)| format!("`{reason}` {colour}"));
        let colours = colours.collect::<Vec<_>>().join(", ");
        let text = operation.description.get_or_insert_default();
        text.push_str(&format!("\n\nColours of rejected stretches: {colours}."));
    }
    let components = api.components.get_or_insert_with(Components::new);
    components.schemas.insert(Problem::name().into_owned(), Problem::schema());
    let mut more = Vec::new();
    Problem::schemas(&mut more);
    components.schemas.extend(more);
    components.schemas.values_mut().for_each(octets::describe_schema);
    let scheme = HttpBuilder::new()
        .scheme(HttpAuthScheme::Bearer)
        .description(Some("A token of the service's configuration (`triplanar token` makes one)."))
        .build();
    components.add_security_scheme(BEARER, SecurityScheme::Http(scheme));
    api
}

/// A body that may be left out is described by what it holds where it is there, not as that or `null`:
/// generated clients send `null`, or nothing that is JSON, for a body of two kinds that is left out.
fn without_null(operation: &mut Operation) {
    let Some(RefOr::T(body)) = &mut operation.request_body else { return };
    for content in body.content.values_mut() {
        let RefOr::T(Content { schema: Some(schema), .. }) = content else { continue };
        let RefOr::T(Schema::OneOf(either)) = schema else { continue };
        let is_null = |item: &RefOr<Schema>| matches!(item, RefOr::T(Schema::Object(object)) if object.schema_type == SchemaType::Type(Type::Null));
        either.items.retain(|item| !is_null(item));
        if either.items.len() == 1 {
            *schema = either.items.remove(0);
        }
    }
}

/// [`openapi`] as the text of a file.
///
/// # Panics
/// Never: the description has string keys alone.
#[must_use]
pub fn openapi_json() -> String {
    let mut text = serde_json::to_string_pretty(&openapi()).expect("string keys alone");
    text.push('\n');
    text
}

/// What stands before the operations.
pub(super) fn head() -> OpenApi {
    let mut license = LicenseBuilder::new().name("MIT").build();
    license.identifier = Some("MIT".to_owned());
    let info: Info = InfoBuilder::new()
        .title("triplanar")
        .version(env!("CARGO_PKG_VERSION"))
        .description(Some(ABOUT))
        .license(Some(license))
        .contact(Some(ContactBuilder::new().name(Some("Whoever operates this service")).build()))
        .build();
    let server = ServerBuilder::new().url("/").description(Some("The service that gives this description."));
    let tags = TAGS.map(|(name, about)| TagBuilder::new().name(name).description(Some(about)).build());
    OpenApiBuilder::new().info(info).servers(Some([server.build()])).tags(Some(tags)).build()
}

pub(super) fn operations_of(item: &mut PathItem) -> impl Iterator<Item = (Method, &mut Operation)> {
    let PathItem { get, put, post, delete, .. } = item;
    [(HttpMethod::Get, get), (HttpMethod::Put, put), (HttpMethod::Post, post), (HttpMethod::Delete, delete)]
        .into_iter()
        .filter_map(|(method, operation)| Some((axum_method(&method), operation.as_mut()?)))
}

fn axum_method(method: &HttpMethod) -> Method {
    match method {
        HttpMethod::Put => Method::PUT,
        HttpMethod::Post => Method::POST,
        HttpMethod::Delete => Method::DELETE,
        _ => Method::GET,
    }
}

fn complete(path: &str, method: &Method, operation: &mut Operation) {
    let access = access(method, path);
    let Responses { responses, .. } = &mut operation.responses;
    if path.contains('{') {
        // A parameter with a slash in it makes another path.
        responses.entry("404".to_owned()).or_insert_with(|| described("Nothing is at this path."));
    }
    for (status, description) in ANYWHERE {
        responses.entry(status.to_owned()).or_insert_with(|| described(description));
    }
    if responses.contains_key("206") {
        responses.entry("412".to_owned()).or_insert_with(|| described(CHANGED));
    }
    if method != Method::GET {
        responses.entry("403".to_owned()).or_insert_with(|| described(FOREIGN));
    }
    if access == Access::Open {
        // Said, not left out: no token is needed.
        operation.security = Some(Vec::new());
    } else {
        for (status, description) in PROTECTED {
            responses.entry(status.to_owned()).or_insert_with(|| described(description));
        }
        // The empty one: a service without tokens asks for none.
        let bearer = SecurityRequirement::new(BEARER, Vec::<String>::new());
        operation.security = Some(vec![bearer, SecurityRequirement::default()]);
        let role = format!("Needs a token of the role {}.", access.roles());
        let description = operation.description.take();
        operation.description = Some(match description {
            Some(text) if !text.is_empty() => format!("{text}\n\n{role}"),
            _ => role,
        });
    }
    for (status, response) in responses.iter_mut() {
        if let (true, RefOr::T(response)) = (status.as_str() >= "400", response) {
            as_problem(response);
        }
    }
}

fn with_headers_of_results(operation: &mut Operation) {
    for status in ["200", "206", "304"] {
        let Some(RefOr::T(response)) = operation.responses.responses.get_mut(status) else { continue };
        for (name, description) in about::DESCRIBED {
            let mut header = Header::new(String::schema());
            header.description = Some(description.to_owned());
            response.headers.insert(name.to_owned(), RefOr::T(header));
        }
    }
}

fn described(description: &str) -> RefOr<Response> {
    RefOr::T(ResponseBuilder::new().description(description).build())
}

/// A refusal without a body of its own has a problem as its body.
fn as_problem(response: &mut Response) {
    if response.content.is_empty() {
        let schema = RefOr::Ref(Ref::from_schema_name(Problem::name()));
        let content = ContentBuilder::new().schema(Some(schema)).build();
        response.content.insert(MEDIA_TYPE.to_owned(), RefOr::T(content));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_operation_has_its_row_in_the_table_of_access() {
        let api = openapi();
        let mut operations = 0;
        for (path, mut item) in api.paths.paths {
            for (method, operation) in operations_of(&mut item) {
                operations += 1;
                let open = operation.security.as_ref().is_some_and(Vec::is_empty);
                assert_eq!(access(&method, &path) == Access::Open, open, "{method} {path}");
                assert!(operation.operation_id.is_some() && operation.summary.is_some(), "{method} {path}");
                assert!(
                    operation.description.as_ref().is_some_and(|text| !text.is_empty()),
                    "{method} {path}"
                );
                let [tag] = operation.tags.as_deref().unwrap_or_default() else {
                    panic!("{method} {path}: one tag")
                };
                assert!(TAGS.iter().any(|(name, _)| name == tag), "{method} {path}: {tag} is none of TAGS");
                for (status, response) in &operation.responses.responses {
                    let RefOr::T(response) = response else { continue };
                    if status.as_str() >= "400" {
                        assert!(!response.content.is_empty(), "{method} {path} {status}");
                    }
                }
            }
        }
        assert_eq!(operations, 23);
    }
}
