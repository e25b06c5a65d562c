//! Bodies of bytes in the API's description: a string of the format `binary`, which generated
//! clients read and write as bytes, instead of the list of integers that a `Vec<u8>` is in JSON.

use utoipa::openapi::path::Operation;
use utoipa::openapi::schema::{ArrayItems, KnownFormat, Object, ObjectBuilder, Schema, SchemaFormat, Type};
use utoipa::openapi::{Content, RefOr};

/// Every body of the operation.
pub(super) fn describe(operation: &mut Operation) {
    let request = operation.request_body.iter_mut().filter_map(|body| match body {
        RefOr::T(body) => Some(&mut body.content),
        RefOr::Ref(_) => None,
    });
    let responses = operation.responses.responses.values_mut().filter_map(|response| match response {
        RefOr::T(response) => Some(&mut response.content),
        RefOr::Ref(_) => None,
    });
    for (media_type, content) in request.flatten().chain(responses.flatten()) {
        if let RefOr::T(Content { schema: Some(schema), .. }) = content {
            let format = if media_type.starts_with("text/") { None } else { Some(KnownFormat::Binary) };
            replace(schema, format);
        }
    }
}

/// The same within a schema.
pub(super) fn describe_schema(schema: &mut RefOr<Schema>) {
    replace(schema, Some(KnownFormat::Binary));
}

fn replace(schema: &mut RefOr<Schema>, format: Option<KnownFormat>) {
    if is_octets(schema) {
        let format = format.map(SchemaFormat::KnownFormat);
        let text: Object = ObjectBuilder::new().schema_type(Type::String).format(format).build();
        *schema = RefOr::T(Schema::Object(text));
        return;
    }
    match schema {
        RefOr::T(Schema::Object(object)) => {
            object.properties.values_mut().for_each(|property| replace(property, format.clone()));
        }
        RefOr::T(Schema::Array(array)) => {
            if let ArrayItems::RefOrSchema(items) = &mut array.items {
                replace(items, format);
            }
        }
        _ => {}
    }
}

/// What utoipa makes of a `Vec<u8>`.
fn is_octets(schema: &RefOr<Schema>) -> bool {
    let RefOr::T(Schema::Array(array)) = schema else { return false };
    let ArrayItems::RefOrSchema(items) = &array.items else { return false };
    let RefOr::T(Schema::Object(item)) = &**items else { return false };
    item.format == Some(SchemaFormat::KnownFormat(KnownFormat::Int32)) && item.minimum.is_some()
}
