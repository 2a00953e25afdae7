// The part of Google.Protobuf that generated code and the package use. JSON and the reading of bytes work; writing bytes does not.
using System;
using System.Collections;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Reflection;
using System.Text;

namespace Google.Protobuf
{
    public interface IMessage
    {
        void MergeFrom(CodedInputStream input);
        void WriteTo(CodedOutputStream output);
        int CalculateSize();
        Reflection.MessageDescriptor Descriptor { get; }
    }

    public interface IMessage<T> : IMessage { }

    public interface ICustomDiagnosticMessage { }

    public static class MessageExtensions
    {
        public static byte[] ToByteArray(this IMessage message) { throw new NotSupportedException(); }
        public static void MergeFrom(this IMessage message, byte[] bytes) { message.MergeFrom(new CodedInputStream(bytes)); }
    }

    public sealed class MessageParser<T>
    {
        public MessageParser(Func<T> create) { }
    }

    public sealed class UnknownFieldSet
    {
        public static UnknownFieldSet Clone(UnknownFieldSet other) { return other; }
        public static UnknownFieldSet MergeFrom(UnknownFieldSet set, UnknownFieldSet other) { return set; }
        public static UnknownFieldSet MergeFieldFrom(UnknownFieldSet set, CodedInputStream input) { return set; }
        public void WriteTo(CodedOutputStream output) { }
        public int CalculateSize() { return 0; }
    }

    public sealed class ByteString
    {
        readonly byte[] bytes;
        ByteString(byte[] bytes) { this.bytes = bytes; }
        public static ByteString Empty { get { return new ByteString(new byte[0]); } }
        public static ByteString CopyFrom(byte[] bytes) { return new ByteString(bytes); }
        public static ByteString FromBase64(string text) { return new ByteString(Convert.FromBase64String(text)); }
        public int Length { get { return bytes.Length; } }
        public byte[] ToByteArray() { return (byte[])bytes.Clone(); }
        public string ToBase64() { return Convert.ToBase64String(bytes); }
    }

    public sealed class InvalidProtocolBufferException : IOException { }

    public sealed class CodedInputStream
    {
        readonly byte[] bytes;
        int at;
        uint tag;
        public CodedInputStream(byte[] bytes) { this.bytes = bytes; }
        public uint ReadTag() { return tag = at < bytes.Length ? (uint)Varint() : 0; }
        public ByteString ReadBytes()
        {
            int length = (int)Varint();
            if (length < 0 || at + length > bytes.Length) { throw new InvalidProtocolBufferException(); }
            var part = new byte[length];
            Array.Copy(bytes, at, part, 0, length);
            at += length;
            return ByteString.CopyFrom(part);
        }
        public void SkipLastField()
        {
            switch (tag & 7)
            {
                case 0: Varint(); break;
                case 1: at += 8; break;
                case 2: ReadBytes(); break;
                case 5: at += 4; break;
                default: throw new InvalidProtocolBufferException();
            }
        }
        public string ReadString() { return Encoding.UTF8.GetString(ReadBytes().ToByteArray()); }
        public void ReadMessage(IMessage message) { message.MergeFrom(new CodedInputStream(ReadBytes().ToByteArray())); }
        public float ReadFloat() { at += 4; return BitConverter.ToSingle(bytes, at - 4); }
        public double ReadDouble() { at += 8; return BitConverter.ToDouble(bytes, at - 8); }
        public bool ReadBool() { return Varint() != 0; }
        public int ReadEnum() { return (int)Varint(); }
        public int ReadInt32() { return (int)Varint(); }
        public long ReadInt64() { return (long)Varint(); }
        public uint ReadUInt32() { return (uint)Varint(); }
        public ulong ReadUInt64() { return Varint(); }
        ulong Varint()
        {
            ulong value = 0;
            for (int shift = 0; ; shift += 7)
            {
                if (at >= bytes.Length) { throw new InvalidProtocolBufferException(); }
                value |= (ulong)(bytes[at] & 127) << shift;
                if (bytes[at++] < 128) { return value; }
            }
        }
    }

    public sealed class CodedOutputStream
    {
        public void WriteRawTag(byte a) { }
        public void WriteRawTag(byte a, byte b) { }
        public void WriteMessage(IMessage value) { }
        public void WriteString(string value) { }
        public void WriteBytes(ByteString value) { }
        public void WriteFloat(float value) { }
        public void WriteDouble(double value) { }
        public void WriteBool(bool value) { }
        public void WriteEnum(int value) { }
        public void WriteInt32(int value) { }
        public void WriteInt64(long value) { }
        public void WriteUInt32(uint value) { }
        public void WriteUInt64(ulong value) { }
        public static int ComputeMessageSize(IMessage value) { return 0; }
        public static int ComputeStringSize(string value) { return 0; }
        public static int ComputeBytesSize(ByteString value) { return 0; }
        public static int ComputeEnumSize(int value) { return 0; }
        public static int ComputeInt32Size(int value) { return 0; }
        public static int ComputeInt64Size(long value) { return 0; }
        public static int ComputeUInt32Size(uint value) { return 0; }
        public static int ComputeUInt64Size(ulong value) { return 0; }
    }

    public sealed class FieldCodec<T> { }

    public static class FieldCodec
    {
        public static FieldCodec<T> ForMessage<T>(uint tag, MessageParser<T> parser) { return null; }
        public static FieldCodec<T> ForEnum<T>(uint tag, Func<T, int> to, Func<int, T> from) { return null; }
        public static FieldCodec<T> ForEnum<T>(uint tag, Func<T, int> to, Func<int, T> from, T value) { return null; }
        public static FieldCodec<string> ForString(uint tag) { return null; }
        public static FieldCodec<string> ForString(uint tag, string value) { return null; }
        public static FieldCodec<ByteString> ForBytes(uint tag) { return null; }
        public static FieldCodec<float> ForFloat(uint tag) { return null; }
        public static FieldCodec<float> ForFloat(uint tag, float value) { return null; }
        public static FieldCodec<double> ForDouble(uint tag) { return null; }
        public static FieldCodec<uint> ForUInt32(uint tag) { return null; }
        public static FieldCodec<ulong> ForUInt64(uint tag) { return null; }
    }

    public class Extension { }
    public sealed class Extension<T, U> : Extension
    {
        public Extension(int number, FieldCodec<U> codec) { }
    }
    public sealed class RepeatedExtension<T, U> : Extension
    {
        public RepeatedExtension(int number, FieldCodec<U> codec) { }
    }

    public static class ProtoPreconditions
    {
        public static T CheckNotNull<T>(T value, string name)
        {
            if (value == null) { throw new ArgumentNullException(name); }
            return value;
        }
    }

    public sealed class JsonFormatter
    {
        public static readonly JsonFormatter Default = new JsonFormatter();
        public static string ToDiagnosticString(IMessage message) { return Default.Format(message); }
        public string Format(IMessage message)
        {
            var text = new StringBuilder();
            JsonFields.Write(text, message);
            return text.ToString();
        }
    }

    public sealed class JsonParser
    {
        public sealed class Settings
        {
            public static readonly Settings Default = new Settings();
            public Settings WithIgnoreUnknownFields(bool ignore) { return this; }
        }
        public JsonParser(Settings settings) { }
        public T Parse<T>(string json) where T : IMessage, new() { return (T)JsonFields.Fill(global::Json.Read(json), typeof(T)); }
    }

    /// <summary>Protobuf JSON by reflection over generated properties.</summary>
    public static class JsonFields
    {
        public static object Fill(object json, Type type)
        {
            if (type == typeof(WellKnownTypes.Duration))
            {
                double seconds = double.Parse(((string)json).TrimEnd('s'), CultureInfo.InvariantCulture);
                return WellKnownTypes.Duration.FromTimeSpan(TimeSpan.FromSeconds(seconds));
            }
            if (type == typeof(ByteString)) { return ByteString.FromBase64((string)json); }
            if (type.IsEnum)
            {
                foreach (FieldInfo field in type.GetFields(BindingFlags.Public | BindingFlags.Static))
                {
                    if (Original(field) == (string)json) { return field.GetValue(null); }
                }
                throw new ArgumentException(json + " is none of " + type);
            }
            var members = json as Dictionary<string, object>;
            if (members == null) { return Convert.ChangeType(json, type, CultureInfo.InvariantCulture); }
            object message = Activator.CreateInstance(type);
            foreach (KeyValuePair<string, object> member in members)
            {
                PropertyInfo property = type.GetProperty(char.ToUpperInvariant(member.Key[0]) + member.Key.Substring(1));
                if (property == null) { throw new ArgumentException(type + " has no " + member.Key); }
                var list = member.Value as List<object>;
                if (list != null)
                {
                    Type element = property.PropertyType.GetGenericArguments()[0];
                    foreach (object one in list) { ((IList)property.GetValue(message)).Add(Fill(one, element)); }
                }
                else { property.SetValue(message, Fill(member.Value, property.PropertyType)); }
            }
            return message;
        }

        public static void Write(StringBuilder text, object value)
        {
            var message = value as IMessage;
            var list = value as IList;
            if (value is WellKnownTypes.Duration) { text.Append('"').Append(((WellKnownTypes.Duration)value).Seconds()).Append("s\""); }
            else if (message != null) { WriteFields(text, message); }
            else if (list != null)
            {
                text.Append('[');
                for (int i = 0; i < list.Count; i++)
                {
                    if (i > 0) { text.Append(','); }
                    Write(text, list[i]);
                }
                text.Append(']');
            }
            else if (value is bool) { text.Append((bool)value ? "true" : "false"); }
            else if (value is float) { text.Append(((float)value).ToString("R", CultureInfo.InvariantCulture)); }
            else if (value is ByteString) { text.Append('"').Append(((ByteString)value).ToBase64()).Append('"'); }
            else if (value is Enum) { text.Append('"').Append(Original(value.GetType().GetField(value.ToString()))).Append('"'); }
            else { text.Append('"').Append(Convert.ToString(value, CultureInfo.InvariantCulture)).Append('"'); }
        }

        static void WriteFields(StringBuilder text, IMessage message)
        {
            text.Append('{');
            string comma = "";
            Type type = message.GetType();
            foreach (FieldInfo number in type.GetFields(BindingFlags.Public | BindingFlags.Static))
            {
                if (!number.IsLiteral || !number.Name.EndsWith("FieldNumber")) { continue; }
                string name = number.Name.Substring(0, number.Name.Length - "FieldNumber".Length);
                PropertyInfo property = type.GetProperty(name);
                object value = property.GetValue(message);
                PropertyInfo has = type.GetProperty("Has" + name);
                if (has != null ? !(bool)has.GetValue(message) : IsDefault(value)) { continue; }
                text.Append(comma).Append('"').Append(char.ToLowerInvariant(name[0])).Append(name.Substring(1)).Append("\":");
                Write(text, value);
                comma = ",";
            }
            text.Append('}');
        }

        static bool IsDefault(object value)
        {
            var list = value as IList;
            var bytes = value as ByteString;
            return value == null || list != null && list.Count == 0 || bytes != null && bytes.Length == 0 || value.Equals("")
                || value.GetType().IsValueType && value.Equals(Activator.CreateInstance(value.GetType()));
        }

        static string Original(FieldInfo field)
        {
            return ((Reflection.OriginalNameAttribute)field.GetCustomAttributes(typeof(Reflection.OriginalNameAttribute), false)[0]).Name;
        }
    }
}

namespace Google.Protobuf.Collections
{
    public sealed class RepeatedField<T> : List<T>
    {
        public RepeatedField<T> Clone()
        {
            var copy = new RepeatedField<T>();
            copy.AddRange(this);
            return copy;
        }
        public void Add(RepeatedField<T> other) { AddRange(other); }
        public void AddEntriesFrom(CodedInputStream input, FieldCodec<T> codec) { throw new NotSupportedException(); }
        public void WriteTo(CodedOutputStream output, FieldCodec<T> codec) { }
        public int CalculateSize(FieldCodec<T> codec) { return 0; }
    }

    public sealed class MapField<K, V> : Dictionary<K, V>
    {
        public sealed class Codec
        {
            public Codec(FieldCodec<K> keys, FieldCodec<V> values, uint tag) { }
        }
        public MapField<K, V> Clone() { return this; }
        public void Add(MapField<K, V> other) { }
        public void MergeFrom(MapField<K, V> other) { }
        public void AddEntriesFrom(CodedInputStream input, Codec codec) { throw new NotSupportedException(); }
        public void WriteTo(CodedOutputStream output, Codec codec) { }
        public int CalculateSize(Codec codec) { return 0; }
    }

    public static class ProtobufEqualityComparers
    {
        public static readonly IEqualityComparer<float> BitwiseSingleEqualityComparer = EqualityComparer<float>.Default;
        public static readonly IEqualityComparer<double> BitwiseDoubleEqualityComparer = EqualityComparer<double>.Default;
    }
}

namespace Google.Protobuf.Reflection
{
    public sealed class OriginalNameAttribute : Attribute
    {
        public string Name { get; private set; }
        public bool PreferredAlias { get; set; }
        public OriginalNameAttribute(string name) { Name = name; }
    }

    public sealed class MessageDescriptor
    {
        public IList<MessageDescriptor> NestedTypes { get { throw new NotSupportedException(); } }
    }

    public sealed class FileDescriptor
    {
        public IList<MessageDescriptor> MessageTypes { get { throw new NotSupportedException(); } }
        public static FileDescriptor FromGeneratedCode(byte[] data, FileDescriptor[] dependencies, GeneratedClrTypeInfo info)
        {
            return null;
        }
    }

    public sealed class GeneratedClrTypeInfo
    {
        public GeneratedClrTypeInfo(Type[] enums, Extension[] extensions, GeneratedClrTypeInfo[] messages) { }
        public GeneratedClrTypeInfo(
            Type type, object parser, string[] a, string[] b, Type[] c, Extension[] d, GeneratedClrTypeInfo[] e) { }
    }

    public static class DescriptorReflection { public static FileDescriptor Descriptor { get { return null; } } }
    public sealed class FieldOptions { }
    public sealed class FileOptions { }
    public sealed class MessageOptions { }
}

namespace Google.Protobuf.WellKnownTypes
{
    public abstract class Stub<T> : IMessage<T> where T : new()
    {
        public static MessageParser<T> Parser { get { return null; } }
        public Reflection.MessageDescriptor Descriptor { get { throw new NotSupportedException(); } }
        public void MergeFrom(CodedInputStream input) { throw new NotSupportedException(); }
        public void MergeFrom(T other) { }
        public void WriteTo(CodedOutputStream output) { }
        public int CalculateSize() { return 0; }
        public T Clone() { return (T)(object)this; }
    }

    public sealed class Duration : Stub<Duration>
    {
        double seconds;
        public static Duration FromTimeSpan(TimeSpan span) { return new Duration { seconds = span.TotalSeconds }; }
        public string Seconds() { return seconds.ToString("F6", CultureInfo.InvariantCulture); }
    }

    public sealed class Timestamp : Stub<Timestamp> { }
    public sealed class FieldMask : Stub<FieldMask> { }
    public sealed class Empty : Stub<Empty> { }

    public static class DurationReflection { public static Reflection.FileDescriptor Descriptor { get { return null; } } }
    public static class TimestampReflection { public static Reflection.FileDescriptor Descriptor { get { return null; } } }
    public static class FieldMaskReflection { public static Reflection.FileDescriptor Descriptor { get { return null; } } }
    public static class EmptyReflection { public static Reflection.FileDescriptor Descriptor { get { return null; } } }
}
