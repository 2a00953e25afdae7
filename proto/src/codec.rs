//! Encoding of messages.

use std::marker::PhantomData;

use prost::{
    Message, Name,
    bytes::{Buf as _, BufMut as _},
};
use tonic::{
    Status,
    codec::{Codec, DecodeBuf, Decoder, EncodeBuf, Encoder},
};

use crate::parts::{MAX_PARTS, has_too_many_parts};

/// Encodes the same bytes as `tonic_prost::ProstCodec`, but from and into plain slices: prost accesses its buffer once
/// per number, and with gRPC's buffers each access costs more than the number itself. Requests of more than [`MAX_PARTS`] parts are
/// refused before they are decoded; answers come from a server that the client has chosen.
#[derive(Debug)]
pub struct SliceCodec<T, U>(PhantomData<(T, U)>);

impl<T, U> Default for SliceCodec<T, U> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<T, U> Codec for SliceCodec<T, U>
where
    T: Message + 'static,
    U: Message + Name + Default + 'static,
{
    type Encode = T;
    type Decode = U;
    type Encoder = Self;
    type Decoder = Self;

    fn encoder(&mut self) -> Self {
        Self::default()
    }

    fn decoder(&mut self) -> Self {
        Self::default()
    }
}

impl<T: Message, U> Encoder for SliceCodec<T, U> {
    type Item = T;
    type Error = Status;

    fn encode(&mut self, message: T, buffer: &mut EncodeBuf<'_>) -> Result<(), Status> {
        let mut bytes = vec![0; message.encoded_len()];
        let written = message.encode(&mut bytes.as_mut_slice());
        written.map_err(|error| Status::internal(error.to_string()))?;
        buffer.put_slice(&bytes);
        Ok(())
    }
}

impl<T, U: Message + Name + Default> Decoder for SliceCodec<T, U> {
    type Item = U;
    type Error = Status;

    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<U>, Status> {
        let bytes = buffer.copy_to_bytes(buffer.remaining());
        decoded(&bytes).map(Some)
    }
}

/// A received message.
///
/// # Errors
/// The bytes are not this message, or it is a request of too many parts.
pub fn decoded<M: Message + Name + Default>(bytes: &[u8]) -> Result<M, Status> {
    if is_sent_by_clients(M::NAME) && has_too_many_parts::<M>(bytes) {
        let problem = format!("it has more than {MAX_PARTS} messages, texts and lists");
        return Err(Status::internal(problem));
    }
    // gRPC assigns INTERNAL to messages that cannot be decoded.
    M::decode(bytes).map_err(|error| Status::internal(error.to_string()))
}

fn is_sent_by_clients(name: &str) -> bool {
    name.ends_with("Request") || ["Track", "TrackFrame"].contains(&name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1;

    #[test]
    fn what_clients_send_is_refused_with_too_many_parts_and_what_servers_answer_is_not() {
        let holdout = v1::Holdout {
            obstacles: vec![v1::Shape::default(); MAX_PARTS],
            ..v1::Holdout::new("objects/mug")
        };
        let frame = v1::TrackFrame::of(1, holdout.clone());
        assert!(decoded::<v1::TrackFrame>(&frame.encode_to_vec()).is_err());
        let track = v1::Track {
            holdout: Some(holdout),
            ..Default::default()
        };
        assert!(decoded::<v1::Track>(&track.encode_to_vec()).is_err());
        let answer = v1::FindGraspResponse {
            grasps: vec![v1::Grasp::default(); MAX_PARTS + 1],
            ..Default::default()
        };
        assert_eq!(
            decoded::<v1::FindGraspResponse>(&answer.encode_to_vec()).unwrap(),
            answer
        );
    }
}
